"""The history as a recording for the rerun viewer, and the viewer itself.

`recording` writes the file: `contents` goes over the excerpt first and finds the `scene`, then
`file` converts batch by batch: `floor`, `round_lanes`, `door_entities`, `costmap_pictures`,
`robot_track` and `event_markers`; `blueprint` lays them out. What a door is along the timeline
`recorded` comes from `knowledge` and `taken_back`, what a long recording leaves out from
`thinning`. `rerun_sdk` is the only place that imports rerun.

`process` runs its binary: `viewer` as a window or without one, `web` for browsers. `live_view` goes
on where `recording` would end, with each commit that comes, as long as it is `fitting`.
"""
