# shellcheck shell=bash
# Looks for a Vulkan driver of this system that is good enough to be used
# instead of the private lavapipe. Sourced by tools/setup.

# Where loaders look for driver manifests, and where containers that lend a GPU
# put them without telling the loader.
standard_manifests=(/etc/vulkan/icd.d /usr/share/vulkan/icd.d /usr/local/etc/vulkan/icd.d
    /usr/local/share/vulkan/icd.d)
hidden_manifests=(/usr/local/nvidia/share/vulkan/icd.d)

# files_named NAME FOLDERS...: those folders that do not exist are no error.
files_named() {
    local name=$1
    shift
    find "$@" -maxdepth 1 -name "$name" 2>/dev/null || true
}

# Prints the value that VK_DRIVER_FILES needs for the system's drivers: "-" when
# the loader finds them by itself. Fails when there is none.
system_manifests() {
    local named=${VK_DRIVER_FILES:-${VK_ICD_FILENAMES:-}} hidden
    if [ -n "$named" ]; then
        echo "$named"
    elif [ -n "$(files_named '*.json' "${standard_manifests[@]}")" ]; then
        echo -
    else
        hidden=$(files_named '*.json' "${hidden_manifests[@]}" | paste -sd: -)
        [ -n "$hidden" ] && echo "$hidden"
    fi
}

has_library() {
    [[ $(PATH=$PATH:/sbin:/usr/sbin ldconfig -p 2>/dev/null) == *"$1 "* ]]
}

# Reads `vulkaninfo --summary`; prints the first device that will do: Vulkan 1.3,
# and a GPU or a lavapipe of Mesa 24 or newer (older ones are 2 to 5 times slower).
usable_device() {
    awk -F' *= *' '
        function judge() {
            if (!found && name != "" && minor >= 3 && (type !~ /CPU/ || mesa >= 24)) {
                print name " (" driver ")"
                found = 1
            }
        }
        /^GPU[0-9]/ { judge(); name = type = driver = ""; minor = mesa = 0 }
        /apiVersion/ {
            # "4206830 (1.3.238)" or "1.4.305"
            match($2, /[0-9]+\.[0-9]+\.[0-9]+/)
            split(substr($2, RSTART, RLENGTH), part, ".")
            minor = part[1] > 1 ? 99 : part[2]
        }
        /deviceType/ { type = $2 }
        /deviceName/ { name = $2 }
        /driverInfo/ {
            driver = $2
            if (match($2, /Mesa [0-9]+/)) mesa = substr($2, RSTART + 5, RLENGTH - 5) + 0
        }
        END { judge(); exit !found }'
}
