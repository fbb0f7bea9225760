# The rest of the hosts, and what takes long. run.sh reads this file.

host tests/host/mesh.c 88
host tests/host/refine.c 52
host tests/host/job_threads.c 35

# Those that QEMU takes many minutes for, or whose measures it would change: memory that is its own, and small stacks (on
# ARM64 glibc gives no thread less than 128 KiB).
rest() {
    host tests/host/stack.c 9
    host tests/host/farm.cpp 10
    host tests/host/viewport.cpp 6
    host tests/host/wrapper.cpp 180
    options='-fno-exceptions -fno-rtti' as=wrapper_without_exceptions
    host tests/host/wrapper.cpp 180
    options= as=
    host tests/host/memory.c 25 1
    host tests/host/soak.c 15 1000
    host tests/host/allocate.c 8 cpu 1
    # The plug-in is a library of its own, which needs vrtm's.
    if compile tests/host/maya_plugin.cpp maya_plugin.plugin -shared $position -fno-exceptions -fno-rtti; then
        before=$linked
        linked=
        host tests/host/maya_node.cpp 29 ./maya_plugin.plugin 25
        linked=$before
    else
        bad maya_plugin "$hosts/log"
    fi
}
[ "$target" != windows ] || rest

# The GPU backend is compiled up to the linker: nothing here has a driver for it.
if [ "$target" = windows ]; then
    start=$(date +%s)
    if cross check --package vrtm-c >"$hosts/log" 2>&1; then
        good "the GPU backend is checked" "$(since "$start")"
    else
        bad 'the GPU backend is checked' "$hosts/log"
    fi
fi

# That the kernels for ARM64 compute in lanes: of the library's f32 arithmetic, nearly all instructions.
if [ "$target" = arm64 ]; then
    aarch64-linux-gnu-objdump -d "$hosts/$library" |
        grep -oE '[[:space:]]f(add|sub|mul|div|sqrt)[[:space:]]+(s|v[0-9]+\.4s)' >"$hosts/log"
    lanes=$(grep -c '\.4s' "$hosts/log") single=$(grep -c '[[:space:]]s$' "$hosts/log")
    name="NEON does the arithmetic ($lanes instructions in lanes, $single others)"
    if [ "$lanes" -gt $((10 * single)) ]; then good "$name"; else bad "$name"; fi
fi
