# shellcheck shell=bash
# What the scripts share: sourced by bash, with the repository's root as the working directory afterwards.
set -euo pipefail
cd "$(dirname "${BASH_SOURCE[0]}")/.."

say() { printf '%s\n' "$*" >&2; }

# quietly LOG COMMAND...: the command's output goes to LOG, and is shown only when it fails.
quietly() {
  local log=$1
  shift
  mkdir -p "$(dirname "$log")"
  if ! "$@" >"$log" 2>&1 </dev/null; then
    say "failed: $*"
    tail -n 60 "$log" >&2
    say "the whole log: $log"
    return 1
  fi
}

# The packages of packages.txt that this system lacks, one a line. What another package provides counts as there.
missing_packages() {
  local wanted installed
  wanted=$(sed -e 's/#.*//' -e '/^[[:space:]]*$/d' scripts/packages.txt)
  # shellcheck disable=SC2016
  installed=$(dpkg-query -W -f '${db:Status-Abbrev}|${Package}\n${db:Status-Abbrev}|${Provides}\n' 2>/dev/null |
    sed -n 's/^ii |//p' | tr ',' '\n' | sed -e 's/^ *//' -e 's/[ (].*//' | sort -u)
  comm -23 <(sort -u <<<"$wanted") <(printf '%s\n' "$installed")
}

# Installs what is missing on Debian and its relatives; elsewhere names what would be needed and stops unless the tools
# that matter are there.
install_packages() {
  if ! command -v apt-get >/dev/null || ! command -v dpkg-query >/dev/null; then
    local tool
    for tool in g++ cmake ninja python3 mpiexec; do
      if ! command -v "$tool" >/dev/null; then
        say "this is no Debian or Ubuntu, and '$tool' is missing; install what these Debian packages hold:"
        say "$(sed -e 's/#.*//' -e '/^[[:space:]]*$/d' scripts/packages.txt | tr '\n' ' ')"
        exit 1
      fi
    done
    return 0
  fi
  local missing sudo=()
  missing=$(missing_packages)
  [[ -n $missing ]] || return 0
  if [[ $(id -u) -ne 0 ]]; then
    if ! command -v sudo >/dev/null; then
      say "as root, run: apt-get install --no-install-recommends $(tr '\n' ' ' <<<"$missing")"
      exit 1
    fi
    sudo=(sudo)
  fi
  say "installing: $(tr '\n' ' ' <<<"$missing")"
  # A package list that cannot be refreshed (no network) may still be good enough to install from.
  quietly build/log/apt-update.log "${sudo[@]}" apt-get update -q || true
  # shellcheck disable=SC2086
  quietly build/log/apt-install.log "${sudo[@]}" env DEBIAN_FRONTEND=noninteractive \
    apt-get install -q -y --no-install-recommends $missing
}

# build PRESET [TARGET...]: configures and builds; idempotent, silent when it works.
build() {
  local preset=$1
  shift
  quietly "build/log/configure-$preset.log" cmake --preset "$preset"
  quietly "build/log/build-$preset.log" cmake --build --preset "$preset" ${1:+--target "$@"}
}
