"""Live sources: localizing while the robot drives.

- `source`: how a source is typed, its byte stream, lines from bytes, and reconnecting
- `websocket`: Foxglove bridges and rosbridge as byte streams; `translation`: their messages as lines,
  with the poses of `poses`
- `cmucam`: a CMUcam2 on a serial line as a byte stream
- `clocks`: clocks that are set back
- `intake`: validation of lines, on one clock
- `session`: the live session, its queue of pictures and its recording
"""
