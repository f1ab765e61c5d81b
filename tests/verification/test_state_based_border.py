"""The border of a fine zone of laws with nodal fields in a lattice of their elasticity."""

import numpy as np
import pytest

from benchmarks.state_based_border import LAWS, Plate, Zone


@pytest.mark.slow
def test_linear_fields_are_in_equilibrium_at_corners() -> None:
    x, y = np.indices((8, 8))
    zone = Zone((x > 1) & (x < 6) & (y > 1) & (y < 6) & ~((x > 3) & (y > 3)), is_round=False)
    for law in LAWS:
        plate = Plate(zone, law)
        assert plate.residual() < 1e-13  # 3.5e-15 to 7.7e-15
        assert abs(plate.K - plate.K.T).max() < 1e-13
        assert plate.frequencies()[0] > 0  # 0.47 to 0.63
