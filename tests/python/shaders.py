"""Runs gonio's WGSL look-ups on a Vulkan device through wgpu and prints f at every geometry as one JSON object.

Argument: a JSON file {"shader": path, "flake": path of a flake map, "colour": {"index", "per_end", "nodes", "method": [numbers], "values": [r, g, b, ...]},
"directions": [[lx, ly, lz, vx, vy, vz], ...]}. Exit code 77 where the package or a device is missing; the reason goes to stderr.
"""

import json
import struct
import sys

try:
    import numpy as np
    import wgpu
except ImportError as e:
    print(e, file=sys.stderr)
    sys.exit(77)

ENTRY = """
@group(0) @binding(4) var<storage, read> test_directions: array<vec4<f32>>;
@group(0) @binding(5) var<storage, read_write> test_out: array<vec4<f32>>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let i = id.x;
    if (i >= arrayLength(&test_out) / 2u) {
        return;
    }
    let light = test_directions[2u * i].xyz;
    let view = test_directions[2u * i + 1u].xyz;
    test_out[2u * i] = vec4<f32>(gonio_flake_map(light, view), 0.0);
    test_out[2u * i + 1u] = vec4<f32>(gonio_colour_map(light, view), 0.0);
}
"""


def padded(triples):
    """Three numbers to four, as vec4."""
    rows = np.asarray(triples, dtype=np.float32).reshape(-1, 3)
    return np.hstack([rows, np.zeros((len(rows), 1), dtype=np.float32)])


def flake_header(m):
    """The uniform of a flake map from its file."""
    low, high = m["bounds"]
    return struct.pack(
        "<2f2I8f4I",
        1.0 / m["index"], m["edge"], *m["nodes"], *low, 0.0, *high, 0.0,
        m["harmonics"], int(m["transform"] == "log"), 0, 0,
    )


def main(path):
    """Runs every method of the colour map over all directions."""
    with open(path, encoding="utf-8") as f:
        job = json.load(f)
    with open(job["shader"], encoding="utf-8") as f:
        code = f.read() + ENTRY
    with open(job["flake"], encoding="utf-8") as f:
        flake = json.load(f)
    try:
        adapter = wgpu.gpu.request_adapter_sync()
        device = adapter.request_device_sync()
    except Exception as e:  # the package has no class of its own for this
        print(f"no device: {e}", file=sys.stderr)
        sys.exit(77)
    module = device.create_shader_module(code=code)
    pairs = np.asarray(job["directions"], dtype=np.float32)
    count = len(pairs)
    directions = padded(pairs.reshape(-1, 3))
    usage = wgpu.BufferUsage
    out = []
    pipeline = device.create_compute_pipeline(layout="auto", compute={"module": module, "entry_point": "main"})
    colour = job["colour"]
    for method in colour["methods"]:
        header = struct.pack("<2f2I", colour["index"], colour["per_end"], colour["nodes"], method)
        buffers = [
            device.create_buffer_with_data(data=flake_header(flake), usage=usage.UNIFORM),
            device.create_buffer_with_data(data=padded(flake["coefficients"]), usage=usage.STORAGE),
            device.create_buffer_with_data(data=header, usage=usage.UNIFORM),
            device.create_buffer_with_data(data=padded(colour["values"]), usage=usage.STORAGE),
            device.create_buffer_with_data(data=directions, usage=usage.STORAGE),
            device.create_buffer(size=32 * count, usage=usage.STORAGE | usage.COPY_SRC),
        ]
        entries = [{"binding": i, "resource": {"buffer": b, "offset": 0, "size": b.size}} for i, b in enumerate(buffers)]
        group = device.create_bind_group(layout=pipeline.get_bind_group_layout(0), entries=entries)
        encoder = device.create_command_encoder()
        work = encoder.begin_compute_pass()
        work.set_pipeline(pipeline)
        work.set_bind_group(0, group)
        work.dispatch_workgroups((count + 63) // 64)
        work.end()
        device.queue.submit([encoder.finish()])
        out.append(np.frombuffer(device.queue.read_buffer(buffers[5]), dtype=np.float32).reshape(count, 2, 4))
    info = adapter.info
    print(json.dumps({
        "device": f"{info.get('device', '')} ({info.get('backend_type', '')})",
        "flake": out[0][:, 0, :3].tolist(),
        "colour": [o[:, 1, :3].tolist() for o in out],
    }))


main(sys.argv[1])
