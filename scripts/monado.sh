#!/usr/bin/env bash
# Gets Monado, the open OpenXR runtime, and runs a command against it; no headset and no GPU needed.
#   scripts/monado.sh [--xvfb | --remote] [--no-service] [--log FILE] COMMAND [ARGUMENTS...]
#   scripts/monado.sh --fetch        only fetch
#   scripts/monado.sh --folder       fetch if need be and print the folder
#
#   (none)        simulated headset that turns its head, null compositor: 320x240 per eye, 20 Hz
#   --xvfb        the real compositor in a window of a virtual display; XVFB_SCREEN in the command's environment names the
#                 file of the screen's pixels (xwd). Needs Xvfb (Debian: xvfb)
#   --remote      head, eyes and controllers come over TCP 4242 on the loopback (Monado's remote driver)
#   --no-service  the runtime is set up, but its service is not started
#   --log FILE    what the service prints
#
# Where this system's apt offers monado-service (Debian 13 and later), that is installed, with what it needs, and used.
#
# Elsewhere, and if STEREOLUX_MONADO names a folder, Monado and all that it loads come from Debian 13 and are unpacked into
# a folder of their own, so that nothing on the machine changes:
# ${STEREOLUX_MONADO:-${XDG_CACHE_HOME:-$HOME/.cache}/stereolux/monado} (180 MB to fetch, 650 MB there).
# Everything, the command too, starts through that folder's own dynamic linker: Debian 13's drivers and runtime need a
# newer C library than older systems have, and one process can hold only one.
set -euo pipefail

folder="${STEREOLUX_MONADO:-${XDG_CACHE_HOME:-${HOME:-/root}/.cache}/stereolux/monado}"
suite=trixie
architecture=x86_64-linux-gnu
packages=(monado-service libopenxr1-monado mesa-vulkan-drivers libopenxr-loader1 openxr-layer-corevalidation
    vulkan-validationlayers libopenxr-utils libvulkan1 libxkbcommon-x11-0)

fail() {
    echo "monado.sh: $*" >&2
    exit 1
}

# The mirror that this system's own apt uses, so that proxies and caches keep working.
mirror() {
    local uri=""
    # A system that is no Debian has no mirror of Debian's.
    if grep -qs '^ID=debian' /etc/os-release; then
        uri=$(cat /etc/apt/sources.list /etc/apt/sources.list.d/*.list /etc/apt/sources.list.d/*.sources 2>/dev/null |
            sed -nE 's/^(deb( +\[[^]]*\])?|URIs:) +([^ ]+).*/\3/p' | grep -E '/debian/?$' | head -n 1 || true)
    fi
    echo "${uri:-http://deb.debian.org/debian}"
}

# Fetches the packages with all they depend on into $1/root and writes manifests with absolute paths of the final folder.
fetch() {
    local build="$1" keyring=/usr/share/keyrings/debian-archive-keyring.gpg
    [ "$(uname -m)" = x86_64 ] || fail "the packages are fetched for x86_64 only; this machine is $(uname -m)"
    command -v apt-get >/dev/null && command -v dpkg-deb >/dev/null ||
        fail "needs apt-get and dpkg-deb to fetch Monado; elsewhere, install Monado yourself and run the command without this script"
    [ -f "$keyring" ] || fail "$keyring is missing; install debian-archive-keyring"
    mkdir -p "$build/apt/lists/partial" "$build/apt/archives/partial" "$build/apt/parts" "$build/root"
    : >"$build/apt/status"
    cat >"$build/apt/debian.sources" <<SOURCES
Types: deb
URIs: $(mirror)
Suites: $suite
Components: main
Architectures: amd64
Signed-By: $keyring
SOURCES
    local options=(-o "Dir::Etc::sourcelist=$build/apt/debian.sources" -o "Dir::Etc::sourceparts=$build/apt/parts"
        -o "Dir::State::lists=$build/apt/lists" -o "Dir::State::status=$build/apt/status"
        -o "Dir::Cache=$build/apt" -o "Dir::Cache::archives=$build/apt/archives" -o "Dir::Cache::pkgcache=" -o "Dir::Cache::srcpkgcache="
        -o "Dir::Etc::preferences=/dev/null" -o "Dir::Etc::preferencesparts=$build/apt/parts"
        -o "APT::Architecture=amd64" -o "APT::Architectures::=amd64" -o "APT::Install-Recommends=false"
        -o "APT::Sandbox::User=" -o "Debug::NoLocking=1" -o "Acquire::Retries=3" -o "Acquire::Languages=none")
    echo "monado.sh: fetching Monado from $(mirror) into $folder (once)" >&2
    apt-get -qq "${options[@]}" update >&2 ||
        fail "cannot read the package lists of Debian $suite; is there a network?"
    apt-get -qq -y --download-only "${options[@]}" install "${packages[@]}" >&2 ||
        fail "cannot download Monado's packages; is there a network, and room in $folder?"
    local package
    for package in "$build"/apt/archives/*.deb; do
        dpkg-deb -x "$package" "$build/root"
    done
    rm -rf "$build/apt"

    # Manifests name their library as it lies in an installed system; here nothing but an absolute path is found. The two
    # loaders complain about each other's manifests, so these lie apart.
    place_manifests "$build" openxr "$build/root/usr/share/openxr/1/"openxr_monado*.json
    place_manifests "$build" openxr/layers "$build/root/usr/share/openxr/1/api_layers/explicit.d/"*core_validation*.json
    place_manifests "$build" vulkan "$build/root/usr/share/vulkan/icd.d/"lvp_icd*.json
    place_manifests "$build" vulkan/layers "$build/root/usr/share/vulkan/explicit_layer.d/"*validation*.json
}

# place_manifests BUILD KIND FILE...: copies manifests to manifests/KIND, their libraries by absolute path in $folder.
place_manifests() {
    local build="$1" kind="$2" manifest library
    shift 2
    mkdir -p "$build/manifests/$kind"
    for manifest in "$@"; do
        [ -f "$manifest" ] || fail "Debian's packages lack $(basename "$manifest"); has $suite changed?"
        library=$(sed -nE 's|.*"library_path" *: *"([^"]*/)?([^"/]+)".*|\2|p' "$manifest" | head -n 1)
        library=$(find "$build/root/usr/lib" -name "$library" | sort | head -n 1)
        [ -n "$library" ] || fail "the library of $(basename "$manifest") is missing"
        sed -E "s|(\"library_path\" *: *)\"[^\"]*\"|\1\"$folder${library#"$build"}\"|" "$manifest" \
            >"$build/manifests/$kind/$(basename "$manifest")"
    done
}

# Whether this system's own Monado is used: it is a Debian whose apt has the packages.
from_apt() {
    [ -z "${STEREOLUX_MONADO:-}" ] && grep -qs '^ID=debian' /etc/os-release && command -v apt-cache >/dev/null || return 1
    local policy
    policy=$(LC_ALL=C apt-cache policy monado-service 2>/dev/null)
    grep -q '^  Candidate: [^(]' <<<"$policy"
}

# Installs what is missing of the packages.
ensure_installed() {
    local package missing=()
    for package in "${packages[@]}"; do
        dpkg-query -W -f '${Status}' "$package" 2>/dev/null | grep -q 'ok installed' || missing+=("$package")
    done
    [ ${#missing[@]} -eq 0 ] && return 0
    local sudo=()
    [ "$(id -u)" -eq 0 ] || sudo=(sudo)
    echo "monado.sh: installing ${missing[*]}" >&2
    "${sudo[@]}" env DEBIAN_FRONTEND=noninteractive apt-get install -y -qq --no-install-recommends "${missing[@]}" >&2 ||
        fail "cannot install ${missing[*]}; name a folder in STEREOLUX_MONADO to unpack Monado there instead"
}

ensure_fetched() {
    if [ "$route" = apt ]; then
        ensure_installed
        return 0
    fi
    [ -f "$folder/complete" ] && return 0
    mkdir -p "$(dirname "$folder")"
    # One at a time; whoever waits finds it done.
    exec 9>"$folder.lock"
    flock 9
    if [ ! -f "$folder/complete" ]; then
        local build="$folder.partial"
        rm -rf "$build" "$folder"
        mkdir -p "$build"
        fetch "$build"
        date -u >"$build/complete"
        mv "$build" "$folder"
    fi
    exec 9>&-
}

route=folder
if from_apt; then route=apt; fi
mode=null service=yes log=/dev/null
while [ $# -gt 0 ]; do
    case "$1" in
    --fetch) ensure_fetched; exit 0 ;;
    --folder)
        [ "$route" = folder ] || fail "this system's own Monado is used, there is no folder; name one in STEREOLUX_MONADO"
        ensure_fetched
        echo "$folder"
        exit 0
        ;;
    --xvfb) mode=xvfb ;;
    --remote) mode=remote ;;
    --no-service) service=no ;;
    --log) log="${2:?--log needs a file}"; shift ;;
    -h | --help) sed -n '2,/^set /{/^set /d;s/^# \{0,1\}//;p}' "$0"; exit 0 ;;
    --) shift; break ;;
    -*) echo "monado.sh: unknown option $1; see --help" >&2; exit 2 ;;
    *) break ;;
    esac
    shift
done
[ $# -gt 0 ] || { echo "monado.sh: no command given; see --help" >&2; exit 2; }

ensure_fetched
# What starts a program where Monado's libraries are found, and where Monado's files are.
if [ "$route" = apt ]; then
    linker=() root=""
    runtimes=/usr/share/openxr/1/openxr_monado drivers=/usr/share/vulkan/icd.d/lvp_icd
else
    root="$folder/root" lib="$folder/root/usr/lib/$architecture"
    loader=$(find "$root" -name 'ld-linux-x86-64.so.2' | head -n 1)
    [ -n "$loader" ] || fail "$folder is damaged; remove it and run this again"
    linker=("$loader" --library-path "$lib:$lib/blas:$lib/lapack:$lib/pulseaudio:$root/usr/lib")
    runtimes="$folder/manifests/openxr/" drivers="$folder/manifests/vulkan/"
fi
first() { ls "$1"*.json 2>/dev/null | head -n 1; }

work=$(mktemp -d)
children=()
clean_up() {
    local status=$? child ended
    trap - EXIT INT TERM
    for child in "${children[@]}"; do kill "$child" 2>/dev/null || true; done
    for child in "${children[@]}"; do
        ended=0
        wait "$child" 2>/dev/null || ended=$?
        # 128 + SIGABRT or SIGSEGV. Debian's Monado does so once in hundreds of starts.
        if [ "$child" = "${MONADO_PID:-}" ] && [ "$status" != 0 ] && { [ "$ended" = 134 ] || [ "$ended" = 139 ]; }; then
            echo "monado.sh: Monado's service crashed (signal $((ended - 128))), so the command's status $status is not its own; run it again" >&2
            status=75
        fi
    done
    rm -rf "$work"
    exit "$status"
}
trap clean_up EXIT
trap 'exit 130' INT
trap 'exit 143' TERM

chmod 700 "$work"
export XDG_RUNTIME_DIR="$work"
export XR_RUNTIME_JSON="$(first "$runtimes")" VK_DRIVER_FILES="$(first "$drivers")"
[ -n "$XR_RUNTIME_JSON" ] && [ -n "$VK_DRIVER_FILES" ] || fail "Monado's or lavapipe's manifest is missing ($runtimes*, $drivers*)"
# An installed system's loaders find their layers by themselves.
[ "$route" = apt ] ||
    export VK_LAYER_PATH="$folder/manifests/vulkan/layers" XR_API_LAYER_PATH="$folder/manifests/openxr/layers"
unset VK_ICD_FILENAMES

# Waits up to 20 s for a file that process $2 makes.
wait_for() {
    local tries
    for tries in $(seq 200); do
        [ -e "$1" ] && return 0
        kill -0 "$2" 2>/dev/null || return 1
        sleep 0.1
    done
    return 1
}

if [ "$service" = yes ]; then
    settings=(XRT_NO_STDIN=1)
    case "$mode" in
    null) settings+=(SIMULATED_ENABLE=1 XRT_COMPOSITOR_NULL=1) ;;
    # The remote driver's own port is fixed, so only one such service can run at a time.
    remote) settings+=(P_OVERRIDE_ACTIVE_CONFIG=remote XRT_COMPOSITOR_NULL=1) ;;
    xvfb)
        command -v Xvfb >/dev/null || fail "--xvfb needs Xvfb; install xvfb"
        # The server writes the number of the display that it found free.
        Xvfb -displayfd 3 -screen 0 1920x1200x24 -fbdir "$work" -nolisten tcp 3>"$work/display" 2>>"$log" &
        children+=($!)
        for _ in $(seq 100); do [ -s "$work/display" ] && break; sleep 0.1; done
        [ -s "$work/display" ] || fail "Xvfb did not start"
        export DISPLAY=":$(cat "$work/display")" XVFB_SCREEN="$work/Xvfb_screen0"
        settings+=(SIMULATED_ROTATE=1 XRT_COMPOSITOR_FORCE_XCB=1)
        ;;
    esac
    # Settings of the caller come last and win. No validation layer in the service: it would report the runtime's own.
    env -u VK_INSTANCE_LAYERS -u XR_ENABLE_API_LAYERS "${settings[@]}" \
        "${linker[@]}" "$root/usr/bin/monado-service" >>"$log" 2>&1 </dev/null &
    children+=($!)
    export MONADO_PID=$!
    wait_for "$work/monado_comp_ipc" "$MONADO_PID" ||
        fail "Monado's service did not start; run again with --log FILE and look there"
fi

name=$1
program=$name
shift
[ -x "$program" ] || program=$(command -v "$program" || { [ -x "$root/usr/bin/$program" ] && echo "$root/usr/bin/$program"; } || true)
[ -n "$program" ] || fail "$name: no such command; give its path, or put its folder on PATH"
# For a command that starts programs itself: what to put before their names.
export MONADO_RUN="${linker[*]}"
if [ "$(head -c 4 "$program" | tail -c 3)" = ELF ]; then
    "${linker[@]}" "$program" "$@"
else
    "$program" "$@"
fi
