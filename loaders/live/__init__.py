"""Live sources: localizing while the robot drives.

- `source`: how a source is typed, and its byte stream: socket, pipe, growing file
- `websocket`, `bridges`: Foxglove bridges and rosbridge as byte streams
- `translation`: a bridge's messages as lines of a session log
- `listening`: lines from bytes, and reconnecting
- `intake`: validation of lines, on one clock
- `session`: the live session, its queue of pictures and its recording
"""
