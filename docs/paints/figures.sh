#!/bin/sh
# The pictures of docs/paints.md: paints of single flakes recorded by the virtual texture camera, then swept. Argument: the gonio program.
set -eu
gonio=${1:-gonio}
here=$(cd "$(dirname "$0")" && pwd)
out=${2:-paints-figures}
mkdir -p "$out"
cd "$out"
for p in blue brown flip-flop grey; do
    [ -d "$p.textures" ] || "$gonio" scan --texture --instrument tiny --truth "$here/$p.toml" -o "$p.mcap" --force
done
sweep() { "$gonio" paint sweep "$@" --force; }
sweep brown.textures blue.textures --side 200 -o sweep.png                                   # Golla and Klein, Figs. 1 and 6
sweep flip-flop.textures grey.textures --side 200 -o flip-flop.png                           # Fig. 6, last row
sweep blue.textures brown.textures --part lightness --step 0.5 --side 200 -o lightness.png   # Fig. 3
sweep brown.textures blue.textures --part hue --step 0.5 --side 200 -o hue.png               # Fig. 4
sweep brown.textures blue.textures --from=-0.5 --to 1.5 --side 200 -o beyond.png             # Fig. 8
for mm in 2 5 20; do
    sweep blue.textures brown.textures --step 0.5 --side 200 --mm-per-unit $mm -o "distance-$mm.png"
done
# the picture of docs/flakes.md: textures by the reference instrument, the BRDF over twelve spins by the tiny one
[ -d silver.textures ] || "$gonio" scan --texture --truth "$here/silver.toml" -o silver.mcap --force
"$gonio" scan --instrument tiny --plan "$here/spins.toml" --truth "$here/silver.toml" -o silver-spins.mcap --fit=lambert --force
"$gonio" fit silver-spins.nc --model car-paint --coat 1.5 --flakes silver.textures -o silver.paint --force
"$gonio" render silver.paint --scene "$here/ball.toml" --mm-per-unit 4 -o flakes-near.png --force
"$gonio" render silver.paint --scene "$here/ball.toml" --mm-per-unit 60 -o flakes-far.png --force
