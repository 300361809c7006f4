#!/usr/bin/env bash
# Installs an archive, a package or a wheel of vgs in a bare Debian, and uses it as a user would.
# tools/dist --try runs it, as root in the tree; the file lies beside it.
#
# usage: trial.sh FILE RECOMMENDED      packages that neither archive nor wheel brings, with commas
set -euo pipefail
cd /srv

fail() {
    echo "FAILED: $*" >&2
    exit 1
}

install_it() {
    apt-get -qq update
    case $1 in
    *.deb) apt-get -qq -y install "./$1" ;;
    *)
        # shellcheck disable=SC2046  # a word for each package
        apt-get -qq -y install libstdc++6 libvulkan1 $(tr "," "\n" <<<"$2" | sed "s/|.*//")
        case $1 in
        *.whl)
            apt-get -qq -y install python3-venv
            python3 -m venv /opt/vgs
            # What it depends on lies beside it.
            /opt/vgs/bin/pip install --no-index --find-links /srv "./$1"
            ;;
        *)
            apt-get -qq -y install xz-utils
            tar -C /opt -xf "$1"
            mv /opt/vgs-* /opt/vgs
            ;;
        esac
        ;;
    esac
}

# The commands of a user, who has nothing.
use_it() {
    cd "$HOME"
    run() {
        echo "\$ $*"
        local start=$SECONDS
        "$@" 2>&1 | sed '/^device memory/d; s/^/    /'
        echo "    ($((SECONDS - start)) s)"
    }
    run vgs --version
    run vgs devices
    run vgs phantom -o ct --size 32
    run vgs fit -q ct/ct.nii.gz --roi ct/mask.nii.gz -o splats.ply --iterations 24 --no-eval
    run vgs render -q splats.ply -o picture.png
    [ "$(head -c 4 picture.png | tail -c 3)" = PNG ] || fail "picture.png is no picture"
    if command -v vgs-xr >/dev/null; then
        run vgs-xr splats.ply --simulated --frames 3
    fi
    if [ -x /opt/vgs/bin/python ]; then
        run python -c 'import vgs
splats = vgs.fit("ct/ct.nii.gz", "ct/mask.nii.gz", iterations=24, progress=False)
print(splats, vgs.render(splats, size=(64, 64)).mean())'
    fi
    window
}

# The window is there when it says so, and the screen is no longer black.
window() {
    local lit program start=$SECONDS
    echo "\$ vgs view splats.ply"
    vgs view splats.ply -vv 2>view.log &
    program=$!
    # Debian 12's lavapipe compiles for a minute of a free processor first.
    while [ $((SECONDS - start)) -lt 300 ]; do
        if grep -qs "picture rendered in full" view.log; then break; fi
        kill -0 "$program" 2>/dev/null || break
        sleep 0.2
    done
    sleep 1
    lit=$(tail -c +4096 "$VGS_SCREEN" | tr -d '\0' | wc -c)
    kill "$program" 2>/dev/null || true
    wait "$program" || true
    if ! grep -q "picture rendered in full" view.log || [ "$lit" -lt 100000 ]; then
        sed 's/^/    /' view.log >&2
        fail "the window shows nothing"
    fi
    echo "    (shown within $((SECONDS - start)) s)"
}

if [ "$1" = --use ]; then
    use_it
    exit
fi
for program in cc gcc c++ ld rustc cargo; do
    ! command -v "$program" >/dev/null || fail "this tree is not bare: it has $program"
done
export DEBIAN_FRONTEND=noninteractive
install_it "$@" >install.log 2>&1 || {
    tail -n 20 install.log >&2
    fail "installing $1"
}
dpkg-query -W -f '    ${Package} ${Version}\n' libc6 libvulkan1 mesa-vulkan-drivers
mkdir /home/user
chown 1000:1000 /home/user
chmod a+r "$VGS_SCREEN"
chmod a+x "${VGS_SCREEN%/*}"
exec chroot --userspec=1000:1000 / env HOME=/home/user PATH=/opt/vgs/bin:/usr/bin:/bin bash /srv/trial.sh --use
