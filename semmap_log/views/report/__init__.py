"""A log as one self-contained HTML page, for who installs nothing.

`report` puts the page together: `page_events` reads the excerpt once; `doors`, `plans`, `track`,
`patrols`, `beliefs`, `changes` and `health` make of it what the page shows, as values that JSON
holds; `page` writes them into the files of the folder `page`, which are plain HTML, CSS and
JavaScript.
"""
