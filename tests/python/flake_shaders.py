"""Runs gonio's WGSL flakes on a Vulkan device through wgpu and prints Xi at every geometry and place as one JSON object.

Argument: a JSON file {"shader": path, "header": {"lightness", "hue", "inverse_index", "texel_mm", "counts", "side", "paints", "paths"}, "sines", "inverse",
"corners", "random", "directions": [[lx, ly, lz, vx, vy, vz, x_mm, y_mm], ...]}. Exit code 77 where the package or a device is missing; the reason
goes to stderr.
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
@group(0) @binding(5) var<storage, read> test_directions: array<vec4<f32>>;
@group(0) @binding(6) var<storage, read_write> test_out: array<vec4<f32>>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let i = id.x;
    if (i >= arrayLength(&test_out)) {
        return;
    }
    let light = test_directions[2u * i];
    let view = test_directions[2u * i + 1u];
    test_out[i] = vec4<f32>(gonio_flakes(light.xyz, view.xyz, vec2<f32>(light.w, view.w)), 0.0);
}
"""


def main(path):
    """One pass over all directions."""
    with open(path, encoding="utf-8") as f:
        job = json.load(f)
    with open(job["shader"], encoding="utf-8") as f:
        code = f.read() + ENTRY
    try:
        adapter = wgpu.gpu.request_adapter_sync()
        device = adapter.request_device_sync()
    except Exception as e:  # the package has no class of its own for this
        print(f"no device: {e}", file=sys.stderr)
        sys.exit(77)
    h = job["header"]
    header = struct.pack(
        "<8f2f6I", *h["lightness"], *h["hue"], h["inverse_index"], h["texel_mm"], *h["counts"], h["side"], h["paints"], h["paths"], 0
    )
    rows = np.asarray(job["directions"], dtype=np.float32)
    count = len(rows)
    directions = np.ascontiguousarray(rows[:, [0, 1, 2, 6, 3, 4, 5, 7]])
    usage = wgpu.BufferUsage
    single = lambda name: np.ascontiguousarray(np.asarray(job[name], dtype=np.float32))
    buffers = [
        device.create_buffer_with_data(data=header, usage=usage.UNIFORM),
        device.create_buffer_with_data(data=single("sines"), usage=usage.STORAGE),
        device.create_buffer_with_data(data=np.asarray(job["inverse"], dtype=np.uint32), usage=usage.STORAGE),
        device.create_buffer_with_data(data=single("corners"), usage=usage.STORAGE),
        device.create_buffer_with_data(data=single("random"), usage=usage.STORAGE),
        device.create_buffer_with_data(data=directions, usage=usage.STORAGE),
        device.create_buffer(size=16 * count, usage=usage.STORAGE | usage.COPY_SRC),
    ]
    module = device.create_shader_module(code=code)
    pipeline = device.create_compute_pipeline(layout="auto", compute={"module": module, "entry_point": "main"})
    entries = [{"binding": i, "resource": {"buffer": b, "offset": 0, "size": b.size}} for i, b in enumerate(buffers)]
    group = device.create_bind_group(layout=pipeline.get_bind_group_layout(0), entries=entries)
    encoder = device.create_command_encoder()
    work = encoder.begin_compute_pass()
    work.set_pipeline(pipeline)
    work.set_bind_group(0, group)
    work.dispatch_workgroups((count + 63) // 64)
    work.end()
    device.queue.submit([encoder.finish()])
    out = np.frombuffer(device.queue.read_buffer(buffers[6]), dtype=np.float32).reshape(count, 4)
    info = adapter.info
    print(json.dumps({"device": f"{info.get('device', '')} ({info.get('backend_type', '')})", "flakes": out[:, :3].tolist()}))


main(sys.argv[1])
