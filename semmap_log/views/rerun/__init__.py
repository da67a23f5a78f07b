"""The history as a recording for the rerun viewer, and the viewer itself.

`recording` writes the file: `survey` goes over the `excerpt` first and finds the `scene`, then
`file` converts batch by batch into `floor`, `rounds`, `doors`, `costmap`, `robot` and `events`;
`blueprint` lays them out. What a door is along `recorded` comes from `knowledge` and `taken_back`,
what a long recording leaves out from `thinning`. `sdk` is the only place that imports rerun;
`viewer` runs its binary.
"""
