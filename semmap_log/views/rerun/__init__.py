"""A log's history as a recording for the rerun viewer, and the viewer itself.

`recording` writes the file and lays it out. `contents` goes over the excerpt first and finds the
`scene`; then `file` converts batch by batch, with `robot_track` (and floor plans), `door_entities`,
`costmap_pictures`, `belief_curves` (and rounds) and `sighting_views`. `scene` and `taken_back` hold
what a door is along the timeline `recorded`, and `scene` what a long recording leaves out.
`rerun_sdk` is the only place that imports rerun.

`process` runs its binary, as a window or headless. `live_view` continues where `recording` ends,
with each new commit, as long as it fits the scene; it also serves browsers.
"""
