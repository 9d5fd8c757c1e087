#!/bin/bash
# Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
# Boots a whole machine, qemu's q35 with Debian 12's own kernel: its GPIO simulator and virtual gray
# camera (gpio-sim and vimc, built here from that kernel's source, because Debian leaves them out), the
# synthetic depth camera, the package with its unit. Looks at what the service does there
# (proof_qemu.sh). Without KVM its time is counted in its instructions, a nanosecond each, so that it is as quick for
# itself as a small board, however slow it is for us. The machine's clock stands at 1970; systemd moves it to its own date.
#   qemu_test.sh BUILD_DIR SYNTH_RUNTIME
# As root. Needs mmdebstrap, qemu-system-x86, e2fsprogs (tools/setup system); many minutes without
# KVM (MAPLET_QEMU=kvm), the network and 4 GB of disk.
set -eu
build=$1 synth=$2
here=$(cd "$(dirname "$0")" && pwd)
. "$here/../../support/debian_root.sh"
. "$here/guest.sh"
needs mmdebstrap qemu-system-x86_64 mke2fs debugfs

work=$(mktemp -d "${TMPDIR:-/var/tmp}/mapletd-qemu.XXXXXX")
trap 'rm -rf --one-file-system "$work"' EXIT
root=$work/root
kernel_packages=linux-image-amd64,linux-headers-amd64,linux-source,make,gcc,xz-utils,kmod,initramfs-tools
debian_root qemu "$(libraries | paste -sd,),libcamera-ipa,systemd,systemd-sysv,dbus,udev,jq,procps,$kernel_packages" "$root"
version=$(ls "$root/lib/modules")

# What Debian's kernel lacks, as its source has it. The simulator's interrupts are lacking, too.
build_modules() {
  local source=$root/root/source drivers=linux-source-6.1/drivers
  mkdir -p "$source"
  tar -C "$source" --strip-components=1 -xf "$root"/usr/src/linux-source-6.1.tar.xz \
    $drivers/gpio/gpio-sim.c $drivers/gpio/gpiolib.h linux-source-6.1/kernel/irq/irq_sim.c \
    $drivers/media/test-drivers/vimc
  mkdir "$source/modules"
  mv "$source"/drivers/media/test-drivers/vimc "$source/modules/vimc"
  mv "$source"/drivers/gpio/gpio-sim.c "$source/modules/simulator.c"
  mv "$source"/drivers/gpio/gpiolib.h "$source"/kernel/irq/irq_sim.c "$source/modules/"
  # The descriptor is not for modules; the flow handler that it would call is the line's own.
  sed -i 's/handle_simple_irq(irq_to_desc(\(.*\)));/generic_handle_irq(\1);/' "$source/modules/irq_sim.c"
  cat >"$source/modules/Makefile" <<'EOF'
obj-m := gpio-sim.o vimc/
gpio-sim-y := simulator.o irq_sim.o
EOF
  chroot "$root" make -s -C "/usr/src/linux-headers-$version" M=/root/source/modules \
    CONFIG_VIDEO_VIMC=m modules
  mkdir -p "$root/lib/modules/$version/updates"
  cp "$source/modules/gpio-sim.ko" "$source/modules/vimc/vimc.ko" "$root/lib/modules/$version/updates/"
  chroot "$root" depmod "$version"
}
build_modules >"$work/modules.log" 2>&1 || { tail -30 "$work/modules.log"; exit 1; }
printf '%s\n' MODULES=list COMPRESS=gzip >"$root/etc/initramfs-tools/initramfs.conf"
printf '%s\n' virtio_pci virtio_blk ext4 crc32c_generic >"$root/etc/initramfs-tools/modules"
chroot "$root" update-initramfs -c -k "$version" >"$work/initrd.log" 2>&1 || { cat "$work/initrd.log"; exit 1; }
cp "$root/boot/vmlinuz-$version" "$work/vmlinuz"
cp "$root/boot/initrd.img-$version" "$work/initrd"
rm -rf "$root"/usr/src "$root"/root/source "$root"/usr/lib/gcc "$root"/boot "$root"/var/lib/apt/lists

install_package
install_camera "world=room sim.seed=3 sim.frames=1000000 colour=0 rate_hz=6" mapletd
cp "$here/mapletd-qemu.toml" "$root/etc/mapletd/mapletd.toml"
printf '%s\n' configfs gpio-sim vimc >"$root/etc/modules-load.d/mapletd-proof.conf"
install -m 755 "$here/gpio_lines.sh" "$root/usr/local/sbin/gpio-lines"
cat >"$root/etc/systemd/system/gpio-lines.service" <<'EOF'
[Unit]
After=systemd-modules-load.service sys-kernel-config.mount
Before=mapletd.service
[Service]
Type=oneshot
ExecStart=/usr/local/sbin/gpio-lines
[Install]
WantedBy=multi-user.target
EOF
systemctl --root="$root" --quiet enable gpio-lines
install_proof proof_qemu.sh
install -m 755 "$build/tests/hil_libcamera" "$root/opt/proof/"

mke2fs -q -t ext4 -d "$root" "$work/disk" 2500M
accelerator=${MAPLET_QEMU:-tcg} # MAPLET_QEMU=kvm where that works: a machine may have it and not boot
time_of_its_own=()
[[ $accelerator != tcg ]] || time_of_its_own=(-icount shift=0,sleep=off)
timeout "${MAPLET_QEMU_S:-2000}" qemu-system-x86_64 -machine q35 -accel "$accelerator" "${time_of_its_own[@]}" -cpu max -smp 1 \
  -m 1024 -rtc base=1970-01-02T00:00:00,clock=vm -nic none -display none -no-reboot -monitor none -serial "file:$work/console" \
  -drive "file=$work/disk,if=virtio,format=raw,cache=unsafe" -kernel "$work/vmlinuz" -initrd "$work/initrd" \
  -append "root=/dev/vda rw console=ttyS0 quiet panic=-1 no_timer_check" || true
debugfs -R "cat /opt/proof/result" "$work/disk" >"$work/result" 2>/dev/null
if [[ ! -s $work/result ]]; then
  tail -40 "$work/console"
  echo "FAIL  it did not boot"
  exit 1
fi
echo "accelerator $accelerator, kernel $version"
cat "$work/result"
! grep -q '^FAIL' "$work/result" && grep -q '^PASS  the end' "$work/result"
