"""Opens a flight log with Rerun, compares its message types with those of Foxglove's SDK, and runs what docs/viewers holds."""
import pathlib
import subprocess
import sys

import foxglove.messages
from mcap.reader import make_reader

log, viewers = pathlib.Path(sys.argv[1]), pathlib.Path(sys.argv[2])
rerun = pathlib.Path(sys.executable).parent / "rerun"


def run(*command):
    return subprocess.run(command, check=True, capture_output=True, text=True, timeout=300).stdout


# Rerun reports no errors, and recognises images, transforms, camera and log messages.
issues = run(rerun, "mcap", "check", log)
assert "ok" in issues and not any(word in issues.lower() for word in ["error", "warn", "invalid"]), issues
run(rerun, "mcap", "convert", log, "-o", "flight.rrd")
told = run(rerun, "rrd", "stats", "flight.rrd")
for component in ["EncodedImage:blob", "Transform3D:translation", "Pinhole:image_from_camera", "TextLog:text"]:
    assert component in told, told

# The message types are Foxglove's own, to the byte.
with open(log, "rb") as file:
    schemas = [schema for schema in make_reader(file).get_summary().schemas.values() if schema.encoding == "protobuf"]
assert len(schemas) >= 7
for schema in schemas:
    own = getattr(foxglove.messages, schema.name.removeprefix("foxglove.")).get_schema()
    assert (own.name, own.encoding, own.data) == (schema.name, schema.encoding, schema.data), schema.name

# The scripts for users work.
assert run(sys.executable, viewers / "foxglove_layout.py") == (viewers / "foxglove-layout.json").read_text()
run(sys.executable, viewers / "rerun_flight.py", log, "--save", "viewed.rrd")
assert "/world/scene" in run(rerun, "rrd", "stats", "viewed.rrd")
