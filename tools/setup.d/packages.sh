# shellcheck shell=bash disable=SC2154
# Debian packages without root and without touching the host: an apt with its
# own lists, status and archives downloads them, dpkg-deb unpacks them.
# Sourced by tools/setup, which provides $work (a folder for temporary files).

keyring=/usr/share/keyrings/debian-archive-keyring.gpg
[ -e "$keyring" ] || keyring=${keyring%.gpg}.pgp

# Succeeds where packages can be had; otherwise prints why not.
packages_available() {
    if [ "$(uname -sm)" != "Linux x86_64" ]; then
        echo "this is $(uname -sm), not Linux on x86-64"
    elif ! command -v apt-get >/dev/null || ! command -v dpkg-deb >/dev/null; then
        echo "this system has no apt"
    elif [ -z "${VGS_DEBIAN_MIRROR:-}" ] && ! grep -qsx 'ID="\?debian"\?' /etc/os-release; then
        echo "this system is not Debian (and VGS_DEBIAN_MIRROR names no mirror)"
    elif [ ! -e "$keyring" ]; then
        echo "the package debian-archive-keyring is not installed"
    else
        return 0
    fi
    return 1
}

# The mirror that this machine already uses; apt knows it from its sources even
# before its first update. Debian's own path ends in "/debian" or, for a mirror
# list, in "debian.list"; that leaves out other vendors' "main" components.
debian_mirror() {
    local mirror=${VGS_DEBIAN_MIRROR:-}
    # shellcheck disable=SC2016  # apt fills in REPO_URI
    [ -n "$mirror" ] || mirror=$(apt-get indextargets --no-release-info \
        --format '$(REPO_URI)' 'Component: main' 'Created-By: Packages' 2>/dev/null |
        grep -E '(/debian/?|/debian\.list)$' | head -n 1 || true)
    [ -n "$mirror" ] || die "apt's sources on this machine name no Debian mirror." \
        "Set VGS_DEBIAN_MIRROR to the address of one and run this again."
    echo "$mirror"
}

# private_apt SUITE ARGS...: apt-get with a state of its own for one Debian release.
private_apt() {
    local state=$work/apt-$1 out=$work/apt-$1.log
    shift
    # -c: read after the host's configuration, so that its proxies and
    # certificates hold while its folders and hooks do not.
    if ! (cd "$state/download" && apt-get -c "$state/apt.conf" -qq "$@") >"$out" 2>&1; then
        echo >&2
        grep -E '^(E|W|Err)' "$out" | tail -n 5 >&2 || tail -n 5 "$out" >&2
        die "the package download failed: apt-get $1 (the messages are above)." \
            "Check the network, or name another mirror in VGS_DEBIAN_MIRROR, and run this again." \
            "What is already set up is kept."
    fi
}

# Makes the state for one release and reads its package lists, once per run.
apt_state() {
    local suite=$1 state=$work/apt-$1 mirror
    [ ! -e "$state/ready" ] || return 0
    mirror=$(debian_mirror)
    mkdir -p "$state"/{lists,cache/archives}/partial "$state/download" "$state/none"
    : >"$state/status"
    echo "deb [arch=amd64 target=Packages signed-by=$keyring] $mirror $suite main" >"$state/sources.list"
    cat >"$state/apt.conf" <<CONF
Dir::State "$state";
Dir::State::lists "$state/lists";
Dir::State::status "$state/status";
Dir::Cache "$state/cache";
Dir::Cache::archives "$state/cache/archives";
Dir::Log "$state";
Dir::Etc::sourcelist "$state/sources.list";
Dir::Etc::sourceparts "$state/none";
Dir::Etc::preferences "$state/no-preferences";
Dir::Etc::preferencesparts "$state/none";
Dir::Etc::trusted "$state/no-trusted.gpg";
Dir::Etc::trustedparts "$state/none";
#clear APT::Update::Pre-Invoke;
#clear APT::Update::Post-Invoke;
#clear APT::Update::Post-Invoke-Success;
#clear APT::NeverAutoRemove;
#clear APT::Architectures;
#clear DPkg::Pre-Invoke;
#clear DPkg::Post-Invoke;
#clear DPkg::Pre-Install-Pkgs;
APT::Architecture "amd64";
APT::Architectures { "amd64"; };
APT::Default-Release "";
APT::Install-Recommends "false";
APT::Install-Suggests "false";
// The cache folder may be closed to apt's own user.
APT::Sandbox::User "";
// The lock in tools/setup guards this state; root's locks are not ours to take.
Debug::NoLocking "true";
Acquire::Languages "none";
Acquire::Retries "3";
// Lists that cannot be read are an error, not a warning.
APT::Update::Error-Mode "any";
Acquire::GzipIndexes "false";
CONF
    private_apt "$suite" update
    touch "$state/ready"
}

# unpack SUITE TREE PACKAGES...: exactly these packages into the folder TREE.
unpack() {
    local suite=$1 tree=$2
    shift 2
    apt_state "$suite"
    private_apt "$suite" download "$@"
    unpack_archives "$tree" "$work/apt-$suite/download"
}

# unpack_with_dependencies SUITE TREE STATUS PACKAGES...: these packages and all
# that they need, less what the file STATUS says is there already. What TREE then
# holds is written to TREE/status, in dpkg's form, for the next call.
unpack_with_dependencies() {
    local suite=$1 tree=$2 status=$3
    shift 3
    apt_state "$suite"
    cat "$status" >"$work/apt-$suite/status"
    private_apt "$suite" install -y --download-only "$@"
    unpack_archives "$tree" "$work/apt-$suite/cache/archives"
}

unpack_archives() {
    local tree=$1 archives=$2 deb
    mkdir -p "$tree"
    for deb in "$archives"/*.deb; do
        dpkg-deb -x "$deb" "$tree"
        { dpkg-deb -f "$deb" && printf 'Status: install ok installed\n\n'; } >>"$tree/status"
        rm "$deb"
    done
}
