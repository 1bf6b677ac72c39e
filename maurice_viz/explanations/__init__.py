"""Why the best reference wins, in words and numbers.

words  sentences, and the names of a descriptor's elements
table  the figures of all references as Markdown and as JSON
paths  the entities of explanations, and the names and colors of their columns
"""
