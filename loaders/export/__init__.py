"""Files for other programs.

* `session`: a recording as our session log; `drive`: the same as MCAP, record by record
* `run`: a saved run as MCAP; `tables`: as CSV and Parquet, and paths as TUM; `evo`: as evo's result files
* `mcap`: an MCAP file being written; `ros_messages`: its ROS 2 messages
"""
