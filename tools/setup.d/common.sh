# shellcheck shell=bash
# Shared by the scripts in tools/: where things are, and how they speak.
# Sourced, never run.

VGS_REPO=$(cd -P -- "$(dirname -- "${BASH_SOURCE[0]}")/../.." && pwd)
# shellcheck disable=SC2034  # the sourcing scripts use it
VGS_TOOLS=$VGS_REPO/tools

# Everything that is downloaded stays in one folder outside the repository.
# (`~` rather than $HOME: bash then knows the folder even where HOME is unset.)
home=~
VGS_CACHE=${VGS_CACHE:-${XDG_CACHE_HOME:-$home/.cache}/vgs}
[[ $VGS_CACHE == /* ]] || VGS_CACHE=$PWD/$VGS_CACHE
export VGS_CACHE

die() {
    printf '%s: %s\n' "${0##*/}" "$1" >&2
    shift
    [ $# -eq 0 ] || printf '  %s\n' "$@" >&2
    exit 1
}

# Prints the comment that opens a script: that is its --help.
print_header() {
    sed -n '2,/^[^#]/ { /^#/ s/^# \{0,1\}//p }' "$1"
}

# 75 -> "1 min 15 s"
in_words() {
    if [ "$1" -lt 60 ]; then echo "$1 s"; else echo "$(($1 / 60)) min $(($1 % 60)) s"; fi
}

# A step says what it does when it starts and what it took when it ends. Only
# a terminal gets the first half at once on the same line; a log gets whole lines.
step_begin() {
    step_name=$1
    step_start=$SECONDS
    [ ! -t 1 ] || printf '%s ...' "$step_name"
}

step_end() {
    local took
    took=$(in_words $((SECONDS - step_start)))
    [ ! -t 1 ] || printf '\r\033[K'
    printf '%s: %s%s\n' "$step_name" "$took" "${1:+, $1}"
}

megabytes() {
    du -sm -- "$@" | awk '{ sum += $1 } END { print sum " MB" }'
}

require_cargo() {
    command -v cargo >/dev/null || die "cargo is missing." \
        "Install Rust (stable, 1.95 or newer), with your system's packages or rustup."
    command -v cc >/dev/null || die "a C compiler (cc) is missing." "On Debian: apt-get install gcc libc6-dev"
}

release_program() {
    local target=${CARGO_TARGET_DIR:-target}
    [[ $target == /* ]] || target=$VGS_REPO/$target
    echo "$target/release/$1"
}

# Inside the repository, where cargo finds .cargo/config.toml.
build_release() {
    local package=$1
    shift
    require_cargo
    (cd "$VGS_REPO" && cargo build --release -p "$package" "$@" >&2)
}
