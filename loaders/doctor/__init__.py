"""What a recording holds, and what is wrong with it.

* `inspection`: counts, rates and gaps of a recording, as `inspect` shows them
* `diagnosis`: errors found with truth, a library or numbers alone, and the options that fix them
"""
