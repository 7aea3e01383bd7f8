#!/bin/sh
# Unpacks Mesa's Vulkan drivers of this Debian release's backports into a folder, without installing it.
#
#   tests/nightly/unpack_mesa.sh FOLDER
#
# Prints the two settings that make programs use lavapipe; radeon.json in FOLDER names the driver for AMD. Packages come from the mirror that apt on this machine uses; packages that are
# already installed are used as they are. If FOLDER already contains both, only prints.
set -eu
mkdir -p "$1"
folder=$(cd "$1" && pwd)
icd=$folder/lavapipe.json

if [ ! -s "$folder/radeon.json" ]; then
  . /etc/os-release
  suite=$VERSION_CODENAME-backports
  site=$(apt-get indextargets --format '$(SITE) $(CODENAME) $(COMPONENT)' 'Created-By: Packages' |
    awk -v name="$VERSION_CODENAME" '$2 == name && $3 == "main" { print $1; exit }')
  keyring=/usr/share/keyrings/debian-archive-keyring.gpg
  [ -n "$site" ] || { echo "unpack_mesa: apt on this machine names no mirror of $VERSION_CODENAME" >&2; exit 1; }

  state=$folder/apt
  mkdir -p "$state/lists/partial" "$state/archives/partial" "$state/parts"
  {
    echo "deb [signed-by=$keyring] $site $VERSION_CODENAME main"
    echo "deb [signed-by=$keyring] $site $suite main"
  } >"$state/sources.list"
  backports() {
    apt-get -q -o Dir::Etc::sourcelist="$state/sources.list" -o Dir::Etc::sourceparts="$state/parts" \
      -o Dir::State::lists="$state/lists" -o Dir::Cache::archives="$state/archives" \
      -o Dir::Cache::pkgcache= -o Dir::Cache::srcpkgcache= -o APT::Sandbox::User=root -o Debug::NoLocking=1 "$@"
  }
  backports update >"$state/log" 2>&1 || { cat "$state/log" >&2; exit 1; }
  backports install -y --no-install-recommends --download-only -t "$suite" mesa-vulkan-drivers >>"$state/log" 2>&1 ||
    { cat "$state/log" >&2; exit 1; }
  for package in "$state"/archives/*.deb; do dpkg -x "$package" "$folder"; done
  rm -rf "$state/lists" "$state/archives"

  driver=$(find "$folder" -name libvulkan_lvp.so | head -n 1)
  [ -n "$driver" ] || { echo "unpack_mesa: the packages of $suite hold no lavapipe" >&2; exit 1; }
  for name in "$driver" "$(dirname "$driver")/libvulkan_radeon.so"; do
    case $name in *radeon*) to=$folder/radeon.json ;; *) to=$icd ;; esac
    printf '{"file_format_version": "1.0.0", "ICD": {"library_path": "%s", "api_version": "1.3.0"}}\n' "$name" >"$to"
  done
fi

echo "VK_DRIVER_FILES=$icd"
echo "LD_LIBRARY_PATH=$(dirname "$(find "$folder" -name libvulkan_lvp.so | head -n 1)")"
