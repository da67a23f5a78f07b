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
)  # fmt: skip
