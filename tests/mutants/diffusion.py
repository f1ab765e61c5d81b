"""Lines of diffusion that are broken on purpose."""

from __future__ import annotations

from mutants.mutant import Mutant

DIFFUSION = (
    Mutant(
        "pdsolve/diffusion/operator.py",
        "self._parts), -diags_array(self.outside))",
        "self._parts), diags_array(0 * self.outside))",
        "tests/unit/pdsolve/diffusion/test_masses.py::test_what_all_nodes_exchange_dies_out_alike",
    ),
    Mutant(
        "pdsolve/steppers/theta.py",
        "content[free] = (fixed + dt * theta * rate)[free]",
        "content[free] = (fixed + dt * rate)[free]",
        "tests/unit/pdsolve/diffusion/test_masses.py::test_what_all_nodes_exchange_dies_out_alike",
    ),
    Mutant(
        "pdsolve/diffusion/operator.py",
        "(faster * self.total + self.outside)",
        "faster * self.total",
        "tests/unit/pdsolve/diffusion/test_masses.py::test_the_bound_counts_what_is_exchanged",
    ),
    Mutant(
        "pdsolve/diffusion/conditions.py",
        "        self.exchange[~self.free] = 0\n",
        "",
        "tests/unit/pdsolve/diffusion/test_masses.py::test_held_nodes_exchange_nothing_and_are_supplied_nothing",
    ),
    Mutant(
        "pdsolve/diffusion/masses.py",
        "max(start.inside, abs(self.supplied), abs(self.through))",
        "start.inside",
        "tests/unit/pdsolve/diffusion/test_masses.py::test_the_balance_is_relative_to_the_largest",
    ),
    Mutant(
        "pdsolve/diffusion/masses.py",
        "abs(self.supplied), abs(self.through)",
        "self.supplied, self.through",
        "tests/unit/pdsolve/diffusion/test_masses.py::test_the_balance_is_relative_to_the_largest",
    ),
    Mutant(
        "pdsolve/diffusion/families.py",
        "3: 0.5}",
        "3: 2 / np.pi}",
        "tests/unit/pdsolve/diffusion/test_masses.py::test_the_surface_of_a_solid",
    ),
    Mutant(
        "pdsolve/diffusion/operator.py",
        "inflow = -self.outside * potential",
        "inflow = -self.outside * content",
        "tests/unit/pdsolve/diffusion/test_masses.py::test_a_solid_exchanges_what_is_saturated",
    ),
    Mutant(
        "pdsolve/steppers/euler.py",
        "put_loads(drive, (step - 1) * dt)",
        "put_loads(drive, step * dt)",
        "tests/unit/pdsolve/diffusion/test_masses.py::test_a_source_follows_its_profile",
    ),
    Mutant(
        "pdsolve/steppers/euler.py",
        "prescribe_values(drive, value, step * dt)",
        "prescribe_values(drive, value, (step - 1) * dt)",
        "tests/unit/pdsolve/diffusion/test_masses.py",
    ),
    Mutant(
        "pdsolve/diffusion/operator.py",
        "content > (self",
        "content >= (self",
        "tests/unit/pdsolve/diffusion/test_masses.py::test_a_kinetic_solid_is_liquid_at_C_sat",
    ),
    Mutant(
        "pdsolve/diffusion/surfaces.py",
        "4 * p * q",
        "2 * p * q",
        "tests/unit/pdsolve/diffusion/test_surfaces.py::test_a_strip_conducts_D",
    ),
    Mutant(
        "pdsolve/diffusion/surfaces.py",
        "np.where(free & ~self._are_separated_by_layer(pairs), ",
        "np.where(free, ",
        "tests/unit/pdsolve/diffusion/test_surfaces.py::test_a_layer_parts_what_is_on_both_sides",
    ),
    Mutant(
        "pdsolve/diffusion/surfaces.py",
        "np.concatenate([change, change[outward]])",
        "np.concatenate([change, 0 * change[outward]])",
        "tests/unit/pdsolve/diffusion/test_surfaces.py::test_a_strip_conducts_D",
    ),
    Mutant(
        "pdsolve/lattice/fluxes.py",
        "2.0 * neighbour_D / (D + neighbour_D)",
        "2.0 * D / (D + neighbour_D)",
        "tests/unit/pdsolve/diffusion/test_bonds.py::test_slots_with_a_crack_and_two_media_are_the_list",
    ),
    Mutant(
        "pdsolve/lattice/fluxes.py",
        "tiles.general[t] |= tiles.D",
        "tiles.filled[t] |= tiles.D",
        "tests/unit/pdsolve/diffusion/test_bonds.py::test_slots_with_a_crack_and_two_media_are_the_list",
    ),
    Mutant(
        "pdsolve/laws/fluxes.py",
        "m[i, 0] += m[i, 1]",
        "m[i, 0] += 0.0",
        "tests/unit/pdsolve/diffusion/test_bonds.py::test_slots_are_the_list",
    ),
    Mutant(
        "pdsolve/laws/fluxes.py",
        "(neighbour_concentration if is_solid else concentration) < law.C_sat",
        "concentration < law.C_sat",
        "tests/unit/pdsolve/diffusion/test_bonds.py::test_a_bond_dissolves_into_liquid_below_saturation",
    ),
)
