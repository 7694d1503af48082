#!/bin/sh
# The sweeps behind docs/accuracy.md: benches/accuracy.sh GOLD.binary FOLDER
# GOLD.binary is a MERL table; what each sweep prints goes to FOLDER/NAME.txt, its files to FOLDER/NAME/. About ten minutes on two idle cores.
set -eu
gold=$1
out=$2
goniofit=${GONIOFIT:-target/release/goniofit}
mkdir -p "$out"
run() {
    name=$1
    shift
    echo "$name: goniofit tradeoff $*"
    "$goniofit" tradeoff "$@" --quiet --out "$out/$name" > "$out/$name.txt"
}

"$goniofit" simulate --material glossy-paint --seed 1 --quiet --out "$out/paint.csv" > /dev/null
run fit-demo fit "$out/paint.csv" --parts 1,7,14,28,56,112 --trials 128
run fit-merl fit "$gold" --parts 1,7,14,28,56,112,224,448,896,1792,3584 --strides 5,97,397,3203 --trials 16
run fit-models fit "$gold" --models lambert,phong,lambert+phong,lambert+phong+phong --parts 1 --trials 6
run fit-losses fit "$gold" --losses cosine-l2,l2,log,cuberoot,relative --parts 1 --trials 4
run render-demo render --scene sphere-on-plane --material glossy-paint --samples 4,8,16,32,64,128,256,512 --targets 10%,5%,2%,1%
run render-merl render --scene sphere-on-plane --material "$gold" --samples 4,8,16,32,64,128,256,512
run render-cornell render --scene cornell --depths 1,3 --targets 20%,10%,5%
run render-resolution render --scene sphere --material satin --ways scene --samples 512 --resolutions 15,10,7.5,5
run simulate-plain simulate --material glossy-paint --scan hemisphere:10 --knobs readings,exposure,step --trials 16
run quadrature simulate --material "$gold" --instrument commercial --scan in-plane:15 --knobs quadrature --target-errors 0.3,0.1,1e-2,1e-3,1e-4,1e-5,1e-6,1e-7 --trials 3
run order simulate --material "$gold" --instrument commercial --scan in-plane:30 --knobs order --trials 2
for instrument in standards-lab commercial robot classroom; do
    run "simulate-$instrument" simulate --material glossy-paint --instrument "$instrument" --scan in-plane:5 --knobs readings,effects --average 1,4,16,64
done
run chain chain --material glossy-paint --instrument commercial --scan in-plane:5
# What stands on the holder must have parameters that are known: the fit of the table.
"$goniofit" fit "$gold" --quiet --out "$out/gold.json" > /dev/null
run chain-merl chain --material "$out/gold.json" --instrument commercial --scan in-plane:5
