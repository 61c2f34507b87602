"""Writes tests/golden/extremes.csv: values at the extremes, computed with fifty digits from exactly the numbers that the table holds.

Run: python3 tests/python/extremes.py > tests/golden/extremes.csv (needs mpmath).

Every row names a formula, up to seven inputs (doubles, written so that they read back exactly) and the value. Directions are unit to
rounding; where a formula could start from either, the component that holds the digits is taken: z near grazing.
"""

from mpmath import atan2, cos, mp, mpf, pi, radians, sin, sqrt

mp.dps = 50
COLUMNS = 7


def row(name, inputs, value):
    cells = [repr(float(v)) for v in inputs] + [""] * (COLUMNS - len(inputs))
    print(",".join([name, *cells, mp.nstr(value, 25)]))


def double(v):
    """The nearest double, exactly."""
    return mpf(float(v))


def direction(theta_deg, phi_deg):
    t, p = radians(mpf(theta_deg)), radians(mpf(phi_deg))
    return [double(sin(t) * cos(p)), double(sin(t) * sin(p)), double(cos(t))]


def dielectric(c, n):
    g2 = n * n - 1 + c * c
    if g2 <= 0:
        return mpf(1)
    g = sqrt(g2)
    rs = (c - g) / (c + g)
    rp = (n * n * c - g) / (n * n * c + g)
    return (rs * rs + rp * rp) / 2


def refracted(c, n):
    return sqrt(n * n - 1 + c * c) / n


def norm(v):
    return sqrt(sum(x * x for x in v))


def inside(d, n):
    return [d[0] / n, d[1] / n, refracted(d[2], n)]


def flake(l, v, n):
    a, b = inside(l, n), inside(v, n)
    s = [x + y for x, y in zip(a, b)]
    d = [x - y for x, y in zip(a, b)]
    return atan2(norm(d), norm(s)), atan2(norm(s[:2]), s[2])


def lobe(exponent, l, v):
    s = [x + y for x, y in zip(l, v)]
    nh, hv = s[2] / norm(s), norm(s) / 2
    return (exponent + 1) / (8 * pi) * nh**exponent / (hv * max(l[2], v[2]))


print(",".join(["formula", *[f"x{k}" for k in range(COLUMNS)], "value"]))
for n in ["1.0000000001", "1.0001", "1.33", "1.5", "3.0", "0.7"]:
    n = double(mpf(n))
    for c in ["1", "0.999999999", "0.9", "0.5", "1e-3", "1e-6", "1e-9", "1e-12", "0"]:
        c = double(mpf(c))
        row("dielectric", [c, n], dielectric(c, n))
        if n > 1:
            row("refracted-cos", [c, n], refracted(c, n))
for theta in ["0", "1e-7", "45", "89", "89.9", "89.9999", "89.999999"]:
    for n in ["1", "1.0000001", "1.5"]:
        d, n = direction(theta, "20"), double(mpf(n))
        row("refract-z", [*d, n], refracted(d[2], n))
# mirror direction and beside it, retro-direction, both grazing, nearly opposite
PAIRS = [
    ("30", "30", "180"),
    ("30", "30.0000001", "180"),
    ("30", "30", "179.9999999"),
    ("45", "45", "0"),
    ("45", "45.0000001", "0"),
    ("45", "45", "1e-7"),
    ("0", "0", "0"),
    ("0", "1e-8", "90"),
    ("89.9", "89.9", "180"),
    ("89.9999", "89.9999", "180"),
    ("89.9999", "89.9999", "179.99"),
    ("89.9", "1e-6", "40"),
    ("75", "15", "60"),
]
for ti, to, phi in PAIRS:
    l, v = direction(ti, "0"), direction(to, phi)
    for n in ["1", "1.5"]:
        n = double(mpf(n))
        inc, tilt = flake(l, v, n)
        row("theta-inc", [*l, *v, n], inc)
        row("theta-flake", [*l, *v, n], tilt)
    for exponent in ["0", "1", "1000", "1000000"]:
        row("lobe", [*l, *v, mpf(exponent)], lobe(mpf(exponent), l, v))
