"""Reports: one self-contained HTML page about a saved run.

- `make`: `report`, from a saved run to the page; facts about session, library and configuration
- `choosing`: which events are listed, and which steps get a picture
- `charts`, `map`: where lines and marks lie in the drawings
- `shots`: pictures of a step
- `templates/`: the page, its drawings and its style
"""
