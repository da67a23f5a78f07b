"""A log as one self-contained HTML page, for who installs nothing.

`content` puts the page together: `page_events` reads the excerpt once; `page_doors`, `plans`,
`track`, `last_changes` and `content` itself make of it what the page shows, as values that JSON
holds; `page` writes them into the files of the folder `page`, which are plain HTML, CSS and
JavaScript.
"""
