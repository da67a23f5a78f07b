"""What a person needs to see of a sighting to check it, before any picture is drawn."""
