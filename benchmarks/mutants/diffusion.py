"""Lines of diffusion that are broken on purpose."""

from __future__ import annotations

from benchmarks.mutants.mutant import Mutant

DIFFUSION = (
    Mutant(
        "pdsolve/diffusion/theta.py",
        "(self._operator.tangent() - diags_array(self._done.exchange))",
        "self._operator.tangent()",
        "tests/unit/pdsolve/diffusion/test_masses.py::test_what_all_nodes_exchange_dies_out_alike",
    ),
    Mutant(
        "pdsolve/diffusion/theta.py",
        "self._comes(value) - self._done.exchange * value",
        "self._comes(value)",
        "tests/unit/pdsolve/diffusion/test_masses.py::test_what_all_nodes_exchange_dies_out_alike",
    ),
    Mutant(
        "pdsolve/diffusion/euler.py",
        "(operator.stiffness_bound() / 2 + done.exchange)",
        "(operator.stiffness_bound() / 2)",
        "tests/unit/pdsolve/diffusion/test_masses.py::test_the_bound_counts_what_is_exchanged",
    ),
    Mutant(
        "pdsolve/diffusion/conditions.py",
        "    exchange[~free] = 0\n",
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
        "pdsolve/diffusion/dissolution.py",
        "3: 0.5}",
        "3: 2 / np.pi}",
        "tests/unit/pdsolve/diffusion/test_masses.py::test_the_surface_of_a_solid",
    ),
    Mutant(
        "pdsolve/diffusion/euler.py",
        "supply -= done.exchange * potential",
        "supply += done.exchange * potential",
        "tests/unit/pdsolve/diffusion/test_masses.py::test_what_all_nodes_exchange_dies_out_alike",
    ),
    Mutant(
        "pdsolve/diffusion/euler.py",
        "done.supply((step - 1) * dt, supply)",
        "done.supply(step * dt, supply)",
        "tests/unit/pdsolve/diffusion/test_masses.py::test_a_source_follows_its_profile",
    ),
    Mutant(
        "pdsolve/diffusion/euler.py",
        "done.hold(content, step * dt)",
        "done.hold(content, (step - 1) * dt)",
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
        "np.where(free & ~_parted(links, known, pairs), ",
        "np.where(free, ",
        "tests/unit/pdsolve/diffusion/test_surfaces.py::test_a_layer_parts_what_is_on_both_sides",
    ),
    Mutant(
        "pdsolve/diffusion/surfaces.py",
        "np.concatenate([change, change[outward]])",
        "np.concatenate([change, 0 * change[outward]])",
        "tests/unit/pdsolve/diffusion/test_surfaces.py::test_a_strip_conducts_D",
    ),
)
