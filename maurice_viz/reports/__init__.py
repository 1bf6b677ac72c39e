"""Reports: one self-contained HTML page about a saved run.

- `make`: `report`, from a saved run to the page; facts about session, library and configuration
- `choosing`: which events are listed, and which steps get a picture
- `charts`, `map`: where lines and marks lie in the drawings
- `linked`: the numbers of each step, for the script that links map and traces
- `shots`: pictures of a step
- `pages`: the templates, and what they share
- `templates/`: the page, its drawings, its style and its script
"""
