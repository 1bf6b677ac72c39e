"""Reports: self-contained HTML pages about a saved run, and about trials.

- `make`: `report`, from a saved run to the page; facts about session, library and configuration
- `charts`, `map`: where lines and marks lie in the drawings, the templates, and numbers for the page's script
- `lanes`: what the log says and how each run was localized, as lanes over the steps
- `shots`: which events are listed, which steps get a picture, and the pictures
- `trials_report`: what every variant reached, and where on the floor runs go wrong
- `templates/`: the pages, their drawings, style and script

Words about runs are in `text`, drawings for the viewer in `drawing`.
"""
