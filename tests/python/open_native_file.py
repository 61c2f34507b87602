"""Opens a native file with xarray as a user does and prints what it finds as JSON; exits 77 where xarray or scipy is missing.

usage: open_native_file.py FILE.nc [REWRITTEN.nc]     the second is written back by xarray, without our attributes
"""

import json
import sys

try:
    import scipy  # noqa: F401
    import xarray
except ImportError as missing:
    print(f"did not run: {missing}")
    sys.exit(77)

with xarray.open_dataset(sys.argv[1], engine="scipy") as data:
    data.load()
found = {
    "dims": {str(k): int(v) for k, v in data.sizes.items()},
    "variables": sorted(str(v) for v in data.data_vars),
    "coordinates": sorted(str(v) for v in data.coords),
    "brdf_dims": [str(d) for d in data["brdf"].dims],
    "brdf_sum": float(data["brdf"].sum(dtype="float64")),
    "brdf_at": data["brdf"].sel(theta_i=45.0, theta_o=45.0, phi=180.0).values.astype(float).tolist(),
    "units": data["theta_o"].attrs["units"],
    "value": data.attrs["value"],
    "flags": sorted(int(f) for f in set(data["flag"].values.ravel().tolist())),
    "channels": [bytes(c).decode().strip() for c in data["channel_name"].values],
}
if len(sys.argv) > 2:
    ours = [name for name in data.attrs if name.startswith("gonio_")]
    for name in ours:
        del data.attrs[name]
    data.transpose("phi", "channel", ...).to_netcdf(sys.argv[2], engine="scipy")
print(json.dumps(found))
