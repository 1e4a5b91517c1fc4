#!/bin/bash
# Runs a client against a virtual Tello, each in its own network namespace, connected by a virtual cable: the drone at 192.168.10.1,
# the client at 192.168.10.2, as with a real one. To be run in `unshare -Urn`.
#   namespace.sh DRONE_COMMAND -- CLIENT_COMMAND...
set -e
drone=()
while [ "$1" != "--" ]; do drone+=("$1"); shift; done
shift
ip link set lo up
unshare -n sleep 600 & far=$!
for _ in $(seq 100); do
    [ "$(readlink /proc/$far/ns/net)" != "$(readlink /proc/self/ns/net)" ] && break
    sleep 0.02
done
ip link add vc type veth peer name vd
ip link set vd netns $far
ip addr add 192.168.10.2/24 dev vc; ip link set vc up
there="nsenter -t $far -n"
$there ip addr add 192.168.10.1/24 dev vd; $there ip link set vd up; $there ip link set lo up
ready=$(mktemp)
$there "${drone[@]}" > "$ready" & server=$!
for _ in $(seq 600); do
    grep -q '^tello@' "$ready" && break
    kill -0 $server 2>/dev/null || { echo "the drone ended: $(cat "$ready")"; kill $far; exit 99; }
    sleep 0.1
done
"$@" && code=0 || code=$?
kill -INT $server; wait $server || true
kill $far
rm -f "$ready"
exit $code
