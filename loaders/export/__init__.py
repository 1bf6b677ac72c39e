"""Files for other programs.

* `session`: a recording as our session log, or as MCAP, record by record
* `tables`: a saved run as CSV and Parquet, paths as TUM
* `mcap`: an MCAP file being written, a saved run as one; `ros_messages`: its ROS 2 messages
"""
