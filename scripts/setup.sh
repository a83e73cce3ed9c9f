#!/usr/bin/env bash
# Makes .venv/ with the fdnet command in it, and makes sure that LIGGGHTS can run.
#
#   bash scripts/setup.sh [--headless | --dev] [--local]
#
#   --headless   leave out VTK and OpenGL: no 3-D pictures, movies and ParaView files
#   --dev        also install what the tests, the linter and the type checker need
#   --local      also as root, unpack Debian packages into the local prefix, not into the system
#
# As root, missing Debian packages are installed with apt-get. Without root, the same packages
# are unpacked into .prefix/, and nothing outside the project is written.
# Environment variables:
#   FDNET_PYTHON     the python3 (3.11 or newer) to build .venv/ with
#   FDNET_PREFIX     another place for the local prefix (.prefix is then a link to it)
#   FDNET_LIGGGHTS   a LIGGGHTS binary of your own; then none is installed
# docs/start/install.md describes every step.
set -euo pipefail

root="$(cd "$(dirname "${BASH_SOURCE[0]}")/.." && pwd -P)"
venv="$root/.venv"
prefix="$root/.prefix"
readonly root venv prefix
readonly gl_packages=(libegl1 libegl-mesa0 libgl1-mesa-dri libgl1)
mode=view
local_only=no
python=""

say() { printf 'setup: %s\n' "$*"; }
fail() {
    printf 'setup: %s\n' "$*" >&2
    exit 1
}

read_options() {
    for option in "$@"; do
        case "$option" in
        --headless) mode=headless ;;
        --dev) mode=dev ;;
        --local) local_only=yes ;;
        -h | --help)
            sed -n '2,/^set -e/s/^# \{0,1\}//p' "${BASH_SOURCE[0]}"
            exit 0
            ;;
        *) fail "unknown option '$option': expected --headless, --dev, --local or --help" ;;
        esac
    done
    [ "$(id -u)" -eq 0 ] || local_only=yes
    [ -z "${FDNET_LIGGGHTS:-}" ] || command -v "$FDNET_LIGGGHTS" >/dev/null ||
        fail "FDNET_LIGGGHTS=$FDNET_LIGGGHTS is not a program: name a LIGGGHTS binary, or unset it"
}

fingerprint() {
    { printf '%s\n' "$root" && cat "$root/pyproject.toml" "$root/scripts/setup.sh"; } |
        sha256sum | cut -d' ' -f1
}

# Looks for LIGGGHTS in the same places and the same order as fdnet itself does.
find_liggghts() {
    if [ -n "${FDNET_LIGGGHTS:-}" ]; then
        printf '%s\n' "$FDNET_LIGGGHTS"
    elif ! command -v liggghts && [ -x "$prefix/bin/liggghts" ]; then
        printf '%s\n' "$prefix/bin/liggghts"
    fi
}

is_ready() {
    local stamp="$venv/.fdnet-setup"
    [ -x "$venv/bin/fdnet" ] && [ -n "$(find_liggghts)" ] &&
        "$venv/bin/python" -c '' 2>/dev/null &&
        grep -qxF "$mode $(fingerprint)" "$stamp" 2>/dev/null
}

# Sets `python` to FDNET_PYTHON, else to the first Python that is new enough, else to nothing.
find_python() {
    local candidates=(python3 python3.{14,13,12,11} "$prefix"/usr/bin/python3.{14,13,12,11})
    [ -z "${FDNET_PYTHON:-}" ] || candidates=("$FDNET_PYTHON")
    for python in "${candidates[@]}"; do
        ! "$python" -c 'import sys, venv; sys.exit(sys.version_info < (3, 11))' >/dev/null 2>&1 ||
            return 0
    done
    python=""
    [ -z "${FDNET_PYTHON:-}" ] ||
        fail "FDNET_PYTHON=$FDNET_PYTHON is not a Python 3.11 or newer with its venv module"
}

# Whether a package is installed in the system or was unpacked into the prefix before.
has_package() {
    [ "$(dpkg-query -W -f='${db:Status-Status}' "$1" 2>/dev/null)" = installed ] ||
        grep -qxF "$1" "$prefix/.packages" 2>/dev/null
}

# Prints one line for each Debian package that is needed and missing. In a local prefix
# python3-venv would not find its wheels, so pip comes from its own wheel there.
list_missing_packages() {
    local package pip_from=python3-venv
    [ "$local_only" = no ] || pip_from=python3-pip-whl
    [ -n "$(find_liggghts)" ] || echo liggghts
    [ "$mode" = headless ] || for package in "${gl_packages[@]}"; do
        has_package "$package" || echo "$package"
    done
    if [ -z "$python" ]; then
        printf '%s\n' python3 "$pip_from"
    elif ! "$python" -c 'import ensurepip' 2>/dev/null; then
        has_package "$pip_from" || echo "$pip_from"
    fi
}

# Runs a command and shows its output only when the command fails.
quietly() {
    local log status=0
    log="$(mktemp)"
    "$@" >"$log" 2>&1 </dev/null || status=$?
    if [ "$status" -ne 0 ]; then
        grep -E '(SSLError|ERROR|Could not|Unable|No space)' "$log" | cut -c1-300 | sort -u |
            head -n 4 >&2 || true
        tail -n 5 "$log" >&2
    fi
    rm -f "$log"
    return "$status"
}

install_into_system() {
    export DEBIAN_FRONTEND=noninteractive
    say "installing with apt-get: $*"
    quietly apt-get update -q ||
        say "apt-get update failed (above); going on with the package lists of before"
    quietly apt-get install -q -y --no-install-recommends "$@" ||
        fail "apt-get install failed (above):" \
            "check the network and /etc/apt, or install by hand: $*"
}

# Writes settings for an apt of our own: it uses the system's sources and its list of installed
# packages, and keeps everything else in $1.
write_apt_settings() {
    mkdir -p "$1/state/lists/partial" "$1/cache/archives/partial"
    cat >"$1/apt.conf" <<CONF
Dir::State "$1/state";
Dir::State::status "/var/lib/dpkg/status";
Dir::Cache "$1/cache";
Dir::Log "$1";
APT::Install-Recommends "false";
APT::Sandbox::User "$(id -un)";
Acquire::Languages "none";
Debug::NoLocking "1";
#clear APT::Update::Post-Invoke;
#clear APT::Update::Post-Invoke-Success;
CONF
}

# Prints the packages that apt would install for those named, as name=version, without libc.
list_closure() {
    apt-get -c "$1/apt.conf" -s install "${@:2}" |
        sed -nE 's/^Inst ([^ ]+) (\[[^]]*\] )?\(([^ ]+) .*/\1=\3/p' |
        sed -E '/^(libc6|libc-bin)=/d'
}

unpack_into_prefix() {
    local apt="$prefix/.apt" closure deb
    say "unpacking into $(cd "$prefix" && pwd -P): $* and what they need"
    write_apt_settings "$apt"
    quietly apt-get -c "$apt/apt.conf" update -q || say "apt-get update failed (above)"
    closure="$(list_closure "$apt" "$@" 2>"$apt/errors")" ||
        fail "apt cannot provide $* ($(grep -m 1 '^E:' "$apt/errors")):" \
            "check the network and /etc/apt"
    mkdir -p "$apt/debs"
    # shellcheck disable=SC2086  # one word per package
    (cd "$apt/debs" && quietly apt-get -c "$apt/apt.conf" download $closure) ||
        fail "downloading Debian packages failed (above):" \
            "check the network and the free space in $prefix"
    for deb in "$apt"/debs/*.deb; do
        dpkg-deb --fsys-tarfile "$deb" |
            tar -x -C "$prefix" --no-same-owner --exclude=./usr/share/{doc,man,locale} ||
            fail "unpacking $(basename "$deb") failed:" \
                "check the free space in $prefix (0.6 GB are needed)"
    done
    rm -rf "$apt"
}

link_prefix() {
    local target="${FDNET_PREFIX:-$prefix}"
    [ -e "$prefix" ] || rm -f "$prefix" # a link whose target was deleted
    mkdir -p "$target"
    target="$(cd "$target" && pwd -P)"
    if [ ! -e "$prefix" ]; then
        ln -sfn "$target" "$prefix"
    elif [ "$(cd "$prefix" && pwd -P)" != "$target" ]; then
        fail "FDNET_PREFIX=$FDNET_PREFIX, but $prefix exists already:" \
            "remove it or unset FDNET_PREFIX"
    fi
}

write_command() { cat >"$1" && chmod +x "$1"; }

# with-libraries CMD...: runs CMD with the prefix's shared libraries and software OpenGL.
write_with_libraries() {
    write_command "$prefix/bin/with-libraries" <<'SH'
#!/bin/bash
# Made by fdnet's scripts/setup.sh: runs a command with the libraries of this prefix.
prefix="$(dirname "$(dirname "$(readlink -f "$0")")")"
for libraries in "$prefix"/usr/lib/*-linux-gnu; do break; done
own="$libraries:$prefix/lib/${libraries##*/}"
export LD_LIBRARY_PATH="$own${LD_LIBRARY_PATH:+:$LD_LIBRARY_PATH}"
if [ -d "$prefix/usr/share/glvnd/egl_vendor.d" ]; then
    export __EGL_VENDOR_LIBRARY_DIRS="$prefix/usr/share/glvnd/egl_vendor.d"
    export LIBGL_DRIVERS_PATH="$libraries/dri"
fi
exec "$@"
SH
}

# Makes the command $1 for an Open MPI program ($2 in the prefix), which looks for its own files
# under OPAL_PREFIX.
write_mpi_command() {
    [ -x "$prefix/usr/bin/$2" ] || return 0
    write_command "$prefix/bin/$1" <<SH
#!/bin/bash
# Made by fdnet's scripts/setup.sh.
prefix="\$(dirname "\$(dirname "\$(readlink -f "\$0")")")"
if compgen -G "\$prefix/usr/lib/*/libopen-pal.so.*" >/dev/null; then
    export OPAL_PREFIX="\$prefix/usr"
fi
export OMPI_MCA_$3 OMPI_MCA_mca_base_component_show_load_errors=0
export PMIX_MCA_pcompress_base_silence_warning=1
exec "\$prefix/bin/with-libraries" "\$prefix/usr/bin/$2" "\$@"
SH
}

# Moves Debian's python3 aside and puts a script in its place that gives it its libraries.
write_python_command() {
    local real
    real="$(compgen -G "$prefix/usr/bin/python3.[0-9][0-9]")" || return 0
    [ "$(head -c 2 "$real")" != '#!' ] || return 0
    mv "$real" "$real.real"
    write_command "$real" <<'SH'
#!/bin/bash
# Made by fdnet's scripts/setup.sh. `exec -a` keeps the name by which a virtual environment
# recognises itself.
self="$(readlink -f "$0")"
exec "${self%/usr/bin/*}/bin/with-libraries" \
    /bin/bash -c 'exec -a "$0" "$@"' "$0" "$self.real" "$@"
SH
}

install_packages() {
    local packages
    mapfile -t packages < <(list_missing_packages)
    [ "${#packages[@]}" -gt 0 ] || return 0
    if ! command -v apt-get >/dev/null; then
        say "no apt-get here, so these packages are not installed: ${packages[*]}"
    elif [ "$local_only" = no ]; then
        install_into_system "${packages[@]}"
    else
        link_prefix
        unpack_into_prefix "${packages[@]}"
        mkdir -p "$prefix/bin"
        write_with_libraries
        write_mpi_command liggghts liggghts ess_singleton_isolated=1
        write_mpi_command mpirun mpirun.openmpi plm_rsh_agent=/bin/false
        write_python_command
        printf '%s\n' "${packages[@]}" >>"$prefix/.packages"
    fi
}

# Makes .venv without ensurepip, from Debian's own pip wheel ($1), which runs once it is unpacked.
# That pip reads the system's certificates. Where there are none, it gets those unpacked with it.
make_venv_with_wheel() {
    local site certificates="$prefix/usr/share/ca-certificates/mozilla"
    local bundle="$prefix/ca-certificates.crt"
    "$python" -m venv --clear --without-pip "$venv"
    site="$("$venv/bin/python" -c 'import sysconfig; print(sysconfig.get_path("purelib"))')"
    "$venv/bin/python" -m zipfile -e "$1" "$site/new"
    if [ ! -e /etc/ssl/certs/ca-certificates.crt ] && [ -d "$certificates" ]; then
        cat "$certificates"/*.crt >"$bundle"
        sed -i "s#/etc/ssl/certs/ca-certificates.crt#$bundle#" \
            "$site/new/pip/_vendor/certifi/core.py"
    fi
    mv "$site"/new/* "$site" && rmdir "$site/new"
}

make_venv() {
    local wheel wheels='usr/share/python-wheels/pip-*.whl' stamp="$venv/.fdnet-setup"
    find_python # again, because it may just have been installed
    [ -n "$python" ] ||
        fail "no Python 3.11 or newer with its venv module:" \
            "install one, or name one in FDNET_PYTHON"
    # Keep a .venv that works and was made in this folder.
    if "$venv/bin/python" -m pip --version >/dev/null 2>&1 &&
        { [ ! -e "$stamp" ] || grep -qxF "at $root" "$stamp"; }; then
        return
    fi
    [ ! -L "$venv" ] ||
        fail "$venv is a link to $(readlink -f "$venv");" \
            "making .venv would empty that folder: remove the link"
    say "making .venv with $(command -v "$python") ($("$python" --version))"
    if "$python" -c 'import ensurepip' 2>/dev/null; then
        quietly "$python" -m venv --clear "$venv" ||
            fail "making .venv failed (above): install python3-venv"
    elif wheel="$(compgen -G "$prefix/$wheels" || compgen -G "/$wheels")"; then
        make_venv_with_wheel "$wheel"
    else
        fail "$python has no ensurepip:" \
            "install python3-venv, or name another Python in FDNET_PYTHON"
    fi
}

install_fdnet() {
    local what="$root"
    [ "$mode" = headless ] || what="${root}[$mode]"
    say "installing fdnet and its Python libraries into .venv (about 0.6 GB, with VTK 1.2 GB)"
    quietly "$venv/bin/python" -m pip install -q --disable-pip-version-check --no-input \
        -e "$what" ||
        fail "pip install failed (above):" \
            "check the network, the free space and pip's settings, then run it again"
}

check_liggghts() {
    local liggghts output
    liggghts="$(find_liggghts)"
    [ -n "$liggghts" ] ||
        fail "LIGGGHTS not found: build LIGGGHTS-PUBLIC 3.8 and name its binary in FDNET_LIGGGHTS"
    output="$(printf 'print "it starts"\n' | timeout 60 "$liggghts" -log none 2>&1)" || true
    grep -qF 'it starts' <<<"$output" ||
        fail "$liggghts does not start: $(tail -n 1 <<<"${output:-it printed nothing}")"
    say "LIGGGHTS: $liggghts"
}

main() {
    read_options "$@"
    if is_ready; then
        say "ready ($venv, $(find_liggghts))" && return
    fi
    [ -z "${FDNET_PREFIX:-}" ] || link_prefix
    find_python
    install_packages
    make_venv
    install_fdnet
    check_liggghts
    {
        printf '%s\n' "at $root" "headless $(fingerprint)" "$mode $(fingerprint)"
        [ "$mode" != dev ] || printf '%s\n' "view $(fingerprint)"
    } >"$venv/.fdnet-setup"
    say "ready ($venv)"
}

main "$@"
