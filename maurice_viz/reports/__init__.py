"""Reports: self-contained HTML pages about a saved run, and about trials.

- `make`: `report`, from a saved run to the page; facts about session, library and configuration
- `choosing`: which events are listed, and which steps get a picture
- `charts`, `map`: where lines and marks lie in the drawings
- `lanes`: what the log says and how each run was localized, as lanes over the steps
- `linked`: the numbers of each step, for the script that links map and traces
- `shots`: pictures of a step
- `trials_report`, `atlas`: what every variant reached, and where on the floor runs go wrong
- `pages`: the templates, and what they share
- `templates/`: the pages, their drawings, style and script

Words about runs are in `text`, drawings for the viewer in `drawing`.
"""
