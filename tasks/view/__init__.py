"""`styletrf view SCENE`: the viewer of a scene while its styles are made, served to this machine.

Begin with `view_command`. `page_server` answers requests, `live_viewer` is the page that it serves,
and `store_watch` adds the styles that other commands make.
"""
