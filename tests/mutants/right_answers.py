"""Lines that mend wrong answers, broken on purpose."""

from __future__ import annotations

from mutants.mutant import Mutant

RIGHT_ANSWERS = (
    # bonds that break within a step
    Mutant(
        "pdsolve/schemes/__init__.py",
        "            matches_work=False,\n            exact_load=False,",
        "            matches_work=True,\n            exact_load=False,",
        "tests/verification/test_tear.py::test_in_the_thesis_mode_bonds_are_gone_at_once",
    ),
    Mutant(
        "pdsolve/checks.py",
        "if created > (1 - TAKEN) * spent > 0:",
        "if created > 2 * (1 - TAKEN) * spent > 0:",
        "tests/unit/pdsolve/test_checks.py::test_bonds_that_take_too_little_are_said",
    ),
    Mutant(
        "pdsolve/run/accounts.py",
        "        if system.scheme.symmetric and not self._nodes_changed:\n",
        "        if False:\n",
        "tests/unit/pdsolve/test_checks.py::test_a_run_says_that_its_bonds_took_too_little",
    ),
    Mutant(
        "pdsolve/adaptivity/quadtree/operator.py",
        "law = law_of(model, scheme.matches_work)",
        "law = law_of(model, False)",
        "tests/unit/pdsolve/test_quadtree_settings.py::test_bonds_between_cells_match_their_work_as_those_of_the_mode",
    ),
    # families that lose bonds
    Mutant(
        "pdsolve/laws/gradient.py",
        "        law.share[rows[sound]] = share[sound]\n",
        "",
        "tests/verification/test_families_that_lose_bonds.py::test_torn_families_are_no_stiffer_than_straight_faces",
    ),
    Mutant(
        "pdsolve/run/accounts.py",
        "        if system.time_step > intact_step:",
        "        if False:",
        "tests/verification/test_families_that_lose_bonds.py::test_a_step_that_became_too_long_is_said_to_be_the_cause",
    ),
    # zones of several spacings
    Mutant(
        "pdsolve/schemes/coarse_strength.py",
        'np.minimum(reach, model.finest_horizon_of(rows)) if material.coarse == "matched" else reach',
        "reach",
        "tests/verification/test_zone_strength.py::test_strength_of_a_coarse_zone",
    ),
    Mutant(
        "pdsolve/schemes/coarse_strength.py",
        "reach > model.finest_horizon_of(rows) * (1 + ROUND_OFF)",
        "reach < 0",
        "tests/verification/test_zone_strength.py::test_strength_of_a_coarse_zone",
    ),
    Mutant(
        "pdsolve/schemes/families.py",
        " * (near / far) ** d",
        "",
        "tests/verification/test_zone_strength.py::test_strength_of_ordinary_bonds",
    ),
    Mutant(
        "pdmesh/model/zone_strengths.py",
        "    if acting:\n",
        "    if False:\n",
        "tests/verification/test_zone_strength.py::test_building_warns_of_loads_on_coarse_zones",
    ),
    Mutant(
        "pdsolve/run/recorder.py",
        "    if len(outside):\n",
        "    if False:\n",
        "tests/verification/test_zone_strength.py::test_a_run_says_that_bonds_broke_in_a_coarse_zone",
    ),
    Mutant(
        "pdmesh/model/zone_strengths.py",
        'return any(getattr(condition, axis, None) for axis in ("x", "y", "z", "spin"))',
        "return True",
        "tests/verification/test_zone_strength.py::test_building_warns_of_loads_on_coarse_zones",
    ),
    Mutant(
        "pdmesh/model/possible.py",
        "STATIC, START, COARSE, PINS",
        "STATIC, START, PINS",
        "tests/unit/pdmesh/model/test_possible.py::test_what_cannot_be_is_found",
    ),
    Mutant(
        "pdsolve/model.py",
        "        part.__dict__.update(finest_horizons=self.finest_horizons)\n",
        "",
        "tests/verification/test_zone_strength.py::test_a_window_knows_the_finest_spacing_of_all",
    ),
    # short horizons
    Mutant(
        "pdmesh/model/lattice_calibration.py",
        "1 - anisotropy / float(",
        "1 + anisotropy / float(",
        "tests/verification/test_small_horizons.py::test_springs_of_a_fine_zone_are_isotropic_too",
    ),
    Mutant(
        "pdmesh/model/lattice_calibration.py",
        '(ANISOTROPY[dimension] * total if calibration == "mean" else 0.0)',
        "(ANISOTROPY[dimension] * total)",
        "tests/verification/test_small_horizons.py::test_isotropic_at_the_usual_ratios",
    ),
    Mutant(
        "pdsolve/zone/springs.py",
        "* counted * factors.shells.at(length)",
        "* counted",
        "tests/verification/test_small_horizons.py::test_springs_of_a_fine_zone_are_isotropic_too",
    ),
    Mutant(
        "pdsolve/schemes/families.py",
        "    return weights * _shells(material, ratio).at(length / reach * ratio)",
        "    return weights",
        "tests/verification/test_small_horizons.py::test_ordinary_families_are_isotropic",
    ),
    Mutant(
        "pdsolve/schemes/average_horizon.py",
        "modulus[material_rows] = c * calibrated.shells.at(length / far * ratio)",
        "modulus[material_rows] = c",
        "tests/verification/test_small_horizons.py::test_a_bar_in_the_plane",
    ),
    Mutant(
        "pdsolve/checks.py",
        "        if ratio < USUAL_RATIO and (beams or (springs and not symmetric)):",
        "        if False:",
        "tests/verification/test_small_horizons.py::test_beams_are_not_calibrated_and_say_so",
    ),
    # fatigue
    Mutant(
        "pdsolve/bonds/fatigue_life.py",
        "1 - max(law.ratio, 0.0), 1 - law.ratio)",
        "1 - law.ratio, 1 - law.ratio)",
        "tests/verification/test_fatigue.py::test_a_closed_crack_adds_nothing_to_the_range_of_its_tip",
    ),
    Mutant(
        "pdsolve/bonds/fatigue_life.py",
        "1 - max(law.ratio, 0.0), 1 - law.ratio)",
        "1 - max(law.ratio, 0.0), 1 - max(law.ratio, 0.0))",
        "tests/verification/test_fatigue.py::test_what_a_cycle_leaves_out_costs_no_life",
    ),
    # conditions
    Mutant(
        "pdmesh/model/rigid_bodies.py",
        "turn or not (value is None or (value == 0.0 and moves))",
        "turn or value is not None",
        "tests/unit/pdsolve/test_conditions_of_place.py::test_components_of_initial_velocities_combine",
    ),
    Mutant(
        "pdmesh/model/selection.py",
        "            if kind is type(condition) or not both:",
        "            if True:",
        "tests/unit/pdsolve/test_conditions_of_place.py::test_a_component_is_prescribed_in_one_way",
    ),
    Mutant(
        "pdsolve/checks.py",
        "        if acts < LITTLE * peak:",
        "        if False:",
        "tests/unit/pdsolve/test_conditions_of_place.py::test_a_load_of_which_little_acts_is_named",
    ),
    Mutant(
        "pdsolve/schemes/gripped_edges.py",
        "factor[mask] = np.minimum(1 + lacks[mask] /",
        "factor[mask] = np.minimum(1 + 0 * lacks[mask] /",
        "tests/verification/test_grips_and_loads.py::test_short_bars_stretch_as_much_inside_as_between_their_ends",
    ),
    Mutant(
        "pdsolve/schemes/gripped_edges.py",
        "    corrections[near[is_inside]] = lack[deep[is_inside]]\n",
        "",
        "tests/verification/test_grips_and_loads.py::test_short_bars_stretch_as_much_inside_as_between_their_ends",
    ),
    Mutant(
        "pdmesh/scene/conditions.py",
        "(column > depth + ROUND_OFF) + 0.5 *",
        "(column > depth + ROUND_OFF) + 1.0 *",
        "tests/verification/test_grips_and_loads.py::test_rows_share_a_traction_as_their_families_lack",
    ),
    Mutant(
        "pdsolve/conditions.py",
        "spread = shares * (extent / total(areas[rows] * shares))",
        "spread = shares * (extent / total(areas[rows]))",
        "tests/verification/test_grips_and_loads.py::test_a_traction_without_rows_adds_up_to_itself_times_its_length",
    ),
    Mutant(
        "pdsolve/run/initial_states.py",
        "    state.second[:] += np.where(constrained_components(system.drive), 0.0, pull / model.rho[:, None])\n",
        "",
        "tests/unit/pdsolve/test_conditions_of_place.py::test_a_displaced_run_begins_with_its_forces_and_with_what_is_prescribed",
    ),
    Mutant(
        "pdsolve/conditions.py",
        "    displacement[holds.node[is_displacement], holds.axis[is_displacement]] = now[is_displacement]\n",
        "",
        "tests/unit/pdsolve/test_conditions_of_place.py::test_a_displaced_run_begins_with_its_forces_and_with_what_is_prescribed",
    ),
    Mutant(
        "pdsolve/checks.py",
        "            for earlier_number, before in earlier if value == 0.0 and not sets else ():",
        "            for earlier_number, before in ():",
        "tests/unit/pdsolve/test_conditions_of_place.py::test_a_zero_that_leaves_an_earlier_component_is_named",
    ),
    Mutant(
        "pdmesh/model/values_at_places.py",
        "        if far.max() > BEYOND * extent:",
        "        if False:",
        "tests/unit/pdmesh/model/test_values_of_place.py::test_a_table_holds_a_little_beyond_its_border_and_is_refused_farther_away",
    ),
    # heat and diffusion
    Mutant(
        "pdsolve/diffusion/surfaces.py",
        "sign = ((L - p) / (L + p) + (M - q) / (M + q)) / 2",
        "sign = -((L - p) / (L + p) + (M - q) / (M + q)) / 2",
        "tests/verification/test_convection.py::test_a_slab_of_any_strength_cools_by_the_series",
    ),
    Mutant(
        "pdsolve/diffusion/edges.py",
        "        free &= not inner.any()  # of nodes in several rows each has its share\n",
        "",
        "tests/unit/pdsolve/diffusion/test_edges.py::test_rows_behind_each_other_share_an_exchange",
    ),
    Mutant(
        "pdsolve/diffusion/conditions.py",
        'nearest = 0.0 if self._model.settings.run.solver in ("implicit", "static") else NEAREST',
        "nearest = 0.0",
        "tests/unit/pdsolve/diffusion/test_edges.py::test_a_strong_exchange_leaves_explicit_steps_long",
    ),
    # contact
    Mutant(
        "pdsolve/operators/contact/drawn_faces.py",
        "(depth - delta / 2)[laid]",
        "(0 * depth)[laid]",
        "tests/unit/pdsolve/test_drawn_faces.py::test_nodes_of_a_disc_have_the_normal_and_the_depth_of_its_circle",
    ),
    Mutant(
        "pdsolve/run/motion_checks.py",
        "if width.half < RESOLVED}",
        "if width.half < RESOLVED / 4}",
        "tests/verification/test_hertz.py::test_a_contact_of_round_bodies_narrower_than_four_spacings_is_warned_of",
    ),
    Mutant(
        "pdsolve/operators/contact/drawn_faces.py",
        "    covered = laid & (depth > (1 + ROUND_OFF) * delta)",
        "    covered = laid & (depth > (9 + ROUND_OFF) * delta)",
        "tests/unit/pdsolve/test_drawn_faces.py::test_nodes_of_a_disc_have_the_normal_and_the_depth_of_its_circle",
    ),
    Mutant(
        "pdsolve/checks.py",
        "    if contact is None or contact.restitution == 1 or",
        "    if True or",
        "tests/verification/test_restitution.py::test_a_restitution_that_bodies_do_not_show_is_said",
    ),
    Mutant(
        "pdsolve/operators/contact/round_bodies.py",
        "self._deep = self._half + joined.drawn.beyond",
        "self._deep = self._half",
        "tests/unit/pdsolve/test_round_bodies.py::test_a_round_body_touches_the_drawn_circle_of_another",
    ),
    # numbers that are printed
    Mutant(
        "pdsolve/measures/tips.py",
        "if before < len(away) and",
        "if False and before < len(away) and",
        "tests/unit/pdsolve/measures/test_tips.py::test_a_mean_speed_ends_where_the_crack_reaches_the_edge",
    ),
    Mutant(
        "pdpost/figures/colours.py",
        'beyond, ", ".join(ends))',
        'beyond, "")',
        "tests/unit/pdpost/figures/test_figures.py::test_the_largest_that_a_picture_names_is_the_field_s",
    ),
    Mutant(
        "pdsolve/diffusion/masses.py",
        "    through -= prescribed_amount - transport.held\n",
        "",
        "tests/unit/pdsolve/diffusion/test_masses.py::test_held_nodes_exchange_nothing_and_are_supplied_nothing",
    ),
    Mutant(
        "pdsolve/measures/directions.py",
        "way.angle_from_pre_crack - angle",
        "way.angle_from_pre_crack",
        "tests/unit/pdsolve/measures/test_predicted_directions.py::test_the_last_frame_before_bonds_broke_predicts",
    ),
    Mutant(
        "pdsolve/measures/crack_summary.py",
        "    lines += _small_piece_sentences(summary.fragments)\n",
        "",
        "tests/unit/pdsolve/measures/test_cracks.py::test_pieces_beside_crumbs_are_said_to_be_few",
    ),
    Mutant(
        "pdsolve/laws/material_checks.py",
        "if peak[worst] > LARGE_STRETCH and",
        "if False and",
        "tests/unit/pdsolve/test_material_checks.py::test_E_in_GPa_is_noticed",
    ),
    Mutant(
        "pdmesh/scene/checks.py",
        "        if stretch is not None and stretch > LARGE_STRETCH and material.E < SOFT:",
        "        if False:",
        "tests/unit/pdsolve/test_material_checks.py::test_E_in_GPa_is_noticed",
    ),
    Mutant(
        "pdmesh/scene/checks.py",
        "    if wave > FASTEST_WAVE and DENSITIES[0] <= material.rho <= DENSITIES[1]:",
        "    if wave > FASTEST_WAVE:",
        "tests/unit/pdsolve/test_material_checks.py::test_a_small_scaled_problem_is_built",
    ),
    Mutant(
        "pdsolve/fracture/broken_area.py",
        "* stands_for[which] / 2",
        "/ 2",
        "tests/unit/pdsolve/fracture/test_broken_area.py::test_a_cut_of_a_plate_has_its_length",
    ),
    Mutant(
        "pdsolve/run/progress.py",
        '        lines.append(crack_energy(summary["cracks"], unit))',
        "        pass",
        "tests/verification/test_tear.py::test_a_run_says_what_a_cut_cost_beside_g0_times_its_area",
    ),
    Mutant(
        "pdsolve/measures/crack_summary.py",
        'f"{line}{LEANING}" if abs(prediction.path_deviation) > LEANS else line',
        "line",
        "tests/unit/pdsolve/measures/test_predicted_directions.py::test_a_path_that_leans_to_the_grid_is_told_to",
    ),
    # numbers of numpy, and laws of one's own
    Mutant(
        "pdmesh/model/base_structs.py",
        "                msgspec.structs.force_setattr(self, name, plain_value)",
        "                pass",
        "tests/unit/pdmesh/scene/test_plain_numbers.py::test_numbers_of_numpy_make_the_same_scenes",
    ),
    Mutant(
        "pdmesh/scene/actions.py",
        "    fields = plain(fields)\n",
        "",
        "tests/unit/pdmesh/scene/test_plain_numbers.py::test_numbers_of_numpy_make_the_same_scenes",
    ),
    Mutant(
        "pdsolve/laws/material_checks.py",
        "    bad = np.flatnonzero(~(secant >= -np.finfo(float).eps))",
        "    bad = np.flatnonzero(secant < -np.finfo(float).eps)",
        "tests/unit/pdsolve/test_material_checks.py::test_a_negative_secant_is_named",
    ),
    Mutant(
        "pdmesh/scene/checks.py",
        'raise SceneError(f"{place}: {name} is {value!r:.80}; use a number or a word") from None',
        'raise SceneError(f"{value!r:.80}; use a number or a word") from None',
        "tests/unit/pdmesh/scene/test_plain_numbers.py::test_what_is_no_number_is_named",
    ),
    # many materials
    Mutant(
        "pdmesh/model/material_constants.py",
        "            msgspec.structs.force_setattr(material, name, column[numbers])",
        "            msgspec.structs.force_setattr(material, name, column[numbers[:1]])",
        "tests/unit/pdmesh/model/test_material_columns.py::test_constants_are_those_of_each_material",
    ),
    Mutant(
        "pdmesh/model/selection.py",
        "    np.maximum.at(numbers, rows[rows >= 0], owner[rows >= 0] + 1)",
        "    numbers[rows[rows >= 0]] = owner[rows >= 0][::-1] + 1",
        "tests/unit/pdmesh/model/test_material_columns.py::test_the_last_selection_counts",
    ),
    # equilibria
    Mutant(
        "pdsolve/laws/materials/solid.py",
        "trial = _turned(R, added(_turned(R, sigma), hooke(first, shear, D)))",
        "trial = added(_turned(R, _turned(R, sigma)), hooke(first, shear, D))",
        "tests/laws/test_solids.py::test_rates_are_objective",
    ),
    # pre-cracks and critical stretches
    Mutant(
        "pdsolve/measures/cracked_nodes.py",
        "return np.asarray((broken_count - cut) / np.maximum(family - cut, 1))",
        "return np.asarray(broken_count / np.maximum(family, 1))",
        "tests/unit/pdsolve/measures/test_cracks.py::test_a_pre_crack_is_not_damage",
    ),
    Mutant(
        "pdsolve/measures/cracked_nodes.py",
        "np.minimum(cut, crossing)",
        "cut",
        "tests/unit/pdsolve/measures/test_changing.py::test_a_node_that_is_born_cracked_is_so_since_the_one_before",
    ),
    Mutant(
        "pdmesh/model/fracture_energy.py",
        "    stretch = stretch / calibration(ratio, in_dimension, has_partial_cells(in_dimension)).stretch\n",
        "",
        "tests/unit/pdmesh/model/test_fracture_energy.py::test_bonds_break_at_the_stretch_that_is_set",
    ),
    Mutant(
        "pdmesh/scene/missing_values.py",
        "replace(body, material=_energetic(body.material, scene, body.spacing))",
        "replace(body, material=body.material)",
        "tests/unit/pdmesh/model/test_fracture_energy.py::test_a_body_beside_has_it_at_its_own_spacing",
    ),
    Mutant(
        "pdmesh/model/settings_overlay.py",
        '("material", ("G0", "critical_stretch"))):',
        "):",
        "tests/unit/pdmesh/model/test_fracture_energy.py::test_a_scene_with_a_zone_and_a_region",
    ),
    # refusals and fields
    Mutant(
        "pdsolve/checks.py",
        "    usual_fields = usual(model.grid.dimension)",
        "    usual_fields = usual(2)",
        "tests/unit/pdsolve/test_material_checks.py::test_fields_along_z_may_be_asked_of_a_body",
    ),
    Mutant(
        "pdmesh/model/possible.py",
        "excluded(CONTACT, HEAT, because=NO_HEAT)",
        "excluded(CONTACT, HEAT)",
        "tests/unit/pdmesh/scene/test_separate_bodies.py::test_what_bodies_in_contact_do_not_take_is_refused_for_its_reason",
    ),
    Mutant(
        "pdmesh/model/possible.py",
        "excluded(CONTACT, ADAPTIVE, because=ONE_BODY)",
        "excluded(CONTACT, ADAPTIVE)",
        "tests/unit/pdmesh/scene/test_separate_bodies.py::test_what_bodies_in_contact_do_not_take_is_refused_for_its_reason",
    ),
)
