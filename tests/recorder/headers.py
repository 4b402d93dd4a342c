"""A header for recordings without cores."""

from onboard.recorder.header import RecordingHeader

HEADER = RecordingHeader(
    drive="20250615T150640.000Z",
    software="0",
    seed=(1,),
    now_s=1000.0,
    utc_s=1_750_000_000.0,
    sensors=(),
    config={"car": {"plate": "A1"}},
    dbc=None,
    certificates=None,
    driver=None,
    is_complete=True,
)
