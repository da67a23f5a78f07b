"""What a shipping may say, send and remove: nothing that another one, or a reader, rests on."""

from __future__ import annotations

from mutation.mutant import guard

KEEPING = (
    guard("a small segment that is continued is no older copy", "_Shipping.try_once",
          "check_same_way(self.store.url, self.segments, kept.manifest)",
          "check_same_way(self.store.url, self.closed, kept.manifest)", "test_ship_check"),
    guard("what lies there is not shortened", "_Shipping.try_once",
          "is_ahead(kept.manifest, self.closed)", "False", "test_ship_check"),
    guard("the check names what is gone", "_not_as_named",
          "size is None", "False", "test_ship_check"),
    guard("the check probes what it says", "check_shipping",
          "check_conditions(store)", "", "test_ship_check"),
    guard("a new generation before anything is removed", "remove_superseded",
          "_replaced(store, log_id, lambda now: _with_generation(now, until_ns))",
          "_kept(store, log_id)", "test_removing"),
    guard("who ships forgets what may be removed", "_Shipping._take_generation",
          "self.there.clear()", "", "test_removing"),
    guard("an object of a later generation has another name", "_Shipping._send",
          "object_name(segment.header.number, sha256, self.generation)",
          "object_name(segment.header.number, sha256)", "test_removing"),
    guard("what the manifest names is not removed", "_due",
          "one.name not in named", "True", "test_removing"),
    guard("what is no segment's name is not removed", "_due",
          "is_object_name(one.name)", "True", "test_removing"),
    guard("the store's clock says how old it is", "remove_superseded",
          "_store_time_ns(store) - older_ns", "time.time_ns() - older_ns", "test_removing"),
    guard("who may not remove changes nothing", "_store_time_ns",
          "store.remove(name)", "pass", "test_removing"),
    guard("a segment is held once while it is sent", "_Shipping._send",
          "segment.source.read(0, segment.size)",
          'b"".join([segment.source.read(at, at + 2**20) for at in range(0, segment.size, 2**20)])',
          "test_shipping"),
)  # fmt: skip
