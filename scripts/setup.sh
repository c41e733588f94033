#!/usr/bin/env bash
# What the scripts need of a machine; on Debian and Ubuntu they install what is missing.

# Whether the dynamic linker knows all these libraries.
has_libraries() {
    local known library
    # ldconfig lies outside a plain user's PATH.
    known=$(PATH="$PATH:/sbin:/usr/sbin" ldconfig -p 2>/dev/null) || return 1
    for library; do
        [[ "$known" == *"$library "* ]] || return 1
    done
}

# Whether the Vulkan loader and at least one driver manifest are there. A driver that is there but broken is reported
# by the program itself.
has_vulkan() {
    has_libraries libvulkan.so.1 || return 1
    [ -n "${VK_DRIVER_FILES:-}${VK_ICD_FILENAMES:-}" ] && return 0
    local folder
    for folder in /usr/share/vulkan/icd.d /etc/vulkan/icd.d /usr/local/share/vulkan/icd.d "${HOME:-/root}/.local/share/vulkan/icd.d"; do
        compgen -G "$folder/*.json" >/dev/null && return 0
    done
    return 1
}

apt_install() {
    if ! command -v apt-get >/dev/null; then
        echo "error: please install $* with your system's package manager, then run this again" >&2
        exit 1
    fi
    local sudo=""
    [ "$(id -u)" -eq 0 ] || sudo="sudo"
    echo "installing $*" >&2
    $sudo env DEBIAN_FRONTEND=noninteractive apt-get update -qq
    $sudo env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "$@" >/dev/null
}

ensure_vulkan() {
    has_vulkan && return 0
    apt_install libvulkan1 mesa-vulkan-drivers
}

# Mesa's driver for AMD's cards, which compiles for them without one.
ensure_radv() {
    has_vulkan && { [ -n "${VK_DRIVER_FILES:-}" ] || [ -e /usr/share/vulkan/icd.d/radeon_icd.x86_64.json ]; } && return 0
    apt_install libvulkan1 mesa-vulkan-drivers
}

ensure_build_tools() {
    if ! command -v cargo >/dev/null; then
        [ -f "${HOME:-/root}/.cargo/env" ] && . "${HOME:-/root}/.cargo/env"
    fi
    if ! command -v cargo >/dev/null; then
        echo "error: no cargo found; install Rust from https://rustup.rs, then run this again" >&2
        exit 1
    fi
    # The FLIP metric is C++.
    command -v c++ >/dev/null || apt_install g++
}

# What tests need beside a driver: a validator of SPIR-V, a virtual screen, what windows are opened with there, and Monado,
# fetched once into a cache folder, as OpenXR runtime.
ensure_test_tools() {
    command -v spirv-val >/dev/null || apt_install spirv-tools
    command -v Xvfb >/dev/null || apt_install xvfb
    has_libraries libX11.so.6 libX11-xcb.so.1 libxcb.so.1 libXcursor.so.1 libXi.so.6 libxkbcommon.so.0 libxkbcommon-x11.so.0 ||
        apt_install libx11-6 libx11-xcb1 libxcb1 libxcursor1 libxi6 libxkbcommon0 libxkbcommon-x11-0
    scripts/monado.sh --fetch
}
