"""Reads a session with the stock Python reader and prints what it found as one JSON object.

Needs the packages mcap and mcap-protobuf-support.
"""

import hashlib
import json
import sys

from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory


def main(path):
    found = {
        "image_sha256": [],
        "stated_sha256": [],
        "events": [],
        "poses_done": [],
        "temperatures": [],
        "attachments": [],
    }
    with open(path, "rb") as f:
        reader = make_reader(f, validate_crcs=True, decoder_factories=[DecoderFactory()])
        for _schema, channel, _message, decoded in reader.iter_decoded_messages():
            if channel.topic == "/camera/raw":
                found["image_sha256"].append(hashlib.sha256(decoded.data).hexdigest())
                found["size"] = [decoded.width, decoded.height]
                found["encoding"] = decoded.encoding
                assert decoded.step == 2 * decoded.width
                assert decoded.timestamp.seconds > 0
            elif channel.topic == "/camera/frame":
                found["stated_sha256"].append(decoded.sha256.hex())
                found["lamp_monitor"] = decoded.lamp_monitor
                has = decoded.HasField("sensor_temperature_c")
                found["temperatures"].append(decoded.sensor_temperature_c if has else None)
            elif channel.topic == "/events":
                found["events"].append(decoded.message)
            elif channel.topic == "/pose" and decoded.state == 2:
                found["poses_done"].append(decoded.index)
        found["attachments"] = [a.name for a in reader.iter_attachments()]
    json.dump(found, sys.stdout)


if __name__ == "__main__":
    main(sys.argv[1])
