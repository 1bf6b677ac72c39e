"""Files and values.

* `files`: atomic writes, the cache, pictures in folders; `pictures`: encoding and decoding
* `fields`: checks of values from JSON and tables, values as TOML
"""
