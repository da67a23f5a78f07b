"""What a laser sees of the doors: scans in, visits to doors out; numpy only, no ROS, no log.

    watcher = DoorWatcher()
    visits = watcher.take(scans, doors)     # of `PlacedScan`s and `DoorPlaces`: those that ended
    visits += watcher.close()               # those that were still going on

`door_watcher` is the entry point; `visit` holds what a visit shows, and the model's constants.
"""
