"""`styletrf view SCENE`: the viewer of a scene while its styles are made, served to this machine.

Enters: a command line, and a store in which other commands make styles. Leaves: a page at a local
address, and camera paths that were drawn in it.
Begin with `view_command`. `page_server` answers requests, `live_viewer` is the page that it serves,
and `store_watch` adds the styles that other commands make.
"""
