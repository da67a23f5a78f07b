"""Files of doors, buildings and maps: thesis YAML, CSV, Open-RMF buildings, GeoJSON, map_server."""
