"""Records as dictionaries for JSON. Files of users have these keys, so they stay where a field has a clearer name."""

from __future__ import annotations

import dataclasses
from typing import Any

_ANGLES = {
    "pre_crack_tip": "tip",
    "angle_from_pre_crack": "angle",
    "angle_lower_bound": "low",
    "angle_upper_bound": "high",
}

JSON_KEYS: dict[str, dict[str, str]] = {  # of each record's fields; a field that is not here is its own key
    "BodyFragment": {"node_count": "nodes"},
    "BodyFragments": {"small_piece_count": "crumbs", "small_pieces_mass": "crumbs_mass"},
    "CrackComparison": {
        "mean_distance": "mean",
        "hausdorff_distance": "hausdorff",
        "start_time_difference": "start",
        "branching_time_difference": "branching",
        "split_time_difference": "split",
    },
    "CrackFork": {"angle_between_outer_arms": "angle", "arm_angles": "arms"},
    "DatabaseContents": {
        "node_count": "nodes",
        "bond_count": "bonds",
        "broken_bond_count": "broken",
        "frame_count": "frames",
        "field_count": "fields",
        "last_step": "last",
        "schema_version": "schema",
        "has_checksums": "checksums",
    },
    "EnergyRelease": {
        "crack_length": "length",
        "release_rate": "value",
        "dissipated_before_growth": "before",
        "overall_release_rate": "whole",
    },
    "ForceOpeningCurve": {"condition_name": "name"},
    "InitialCrackDirection": {**_ANGLES, "fitted_length": "length", "overall_angle": "whole"},
    "MassBalance": {"solid_volume": "solid", "solid_surface_area": "surface", "solid_share_left": "left"},
    "NodeHistory": {"node_ids": "nodes", "smallest": "low", "largest": "high", "distance_from_place": "off"},
    "ParisLine": {"point_count": "points"},
    "PlateFragment": {"node_count": "nodes"},
    "PlateFragments": {"small_piece_count": "crumbs", "small_pieces_area": "crumbs_area"},
    "PredictedCrackDirection": {**_ANGLES, "frame_step": "step", "path_deviation": "off"},
    "TipFatigueGrowth": {"grown_length": "length", "growth_per_cycle": "rate", "is_past_slow_start": "settled"},
}


def fields_by_json_key(record: Any) -> dict[str, Any]:
    """The fields of a named tuple or a dataclass by their keys in JSON, in the order of the fields."""
    is_dataclass = dataclasses.is_dataclass(record)
    names = [field.name for field in dataclasses.fields(record)] if is_dataclass else record._fields
    keys = JSON_KEYS.get(type(record).__name__, {})
    return {keys.get(name, name): getattr(record, name) for name in names}
