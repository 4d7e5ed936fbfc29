#!/usr/bin/env bash
# A stranger on the network: writes odometry to a node on another machine, by a Fast DDS peer in a network namespace of its own that a cable joins to the
# node's. What it sends to 127.0.0.1, the only address that a node with the range LOCALHOST gives, a relay takes to the node's address on the cable.
# Usage, in a namespace without a network (unshare -n): stranger.sh RANGE NODE FASTDDS_PEER MESSAGES; prints what the peer prints
set -euo pipefail
range=$1 node=$2 peer=$3 messages=$4
type=nav_msgs/msg/Odometry
export ROS_DOMAIN_ID=7
# The ports of the second participant in domain 7; the first ports are the stranger's own in its namespace.
ports=(9162 9163)
trap 'kill $(jobs -p) 2>/dev/null' EXIT

unshare -n sleep 120 >/dev/null 2>&1 &
far=$!
until [[ $(readlink /proc/$far/ns/net) != $(readlink /proc/self/ns/net) ]]; do sleep 0.05; done
away() { nsenter -t "$far" -n "$@"; }
ip link set lo up
ip link add near type veth peer name away
ip addr add 10.9.0.1/24 dev near && ip link set near up
ip link set away netns "$far"
away ip addr add 10.9.0.2/24 dev away
away ip link set away up && away ip link set lo up

export ROS_AUTOMATIC_DISCOVERY_RANGE=$range
"$node" --ros-args -r __node:=first -r odom:=none >/dev/null 2>&1 &
sleep 1
"$node" >/dev/null 2>&1 &
nsenter -t "$far" -n python3 -c '
import select, socket, sys
taken = {}
for port in map(int, sys.argv[2:]):
    taken[socket.socket(type=socket.SOCK_DGRAM)] = port
for at, port in taken.items():
    at.bind(("127.0.0.1", port))
out = socket.socket(type=socket.SOCK_DGRAM)
while True:
    for at in select.select(list(taken), [], [])[0]:
        out.sendto(at.recv(65536), (sys.argv[1], taken[at]))
' 10.9.0.1 "${ports[@]}" >/dev/null 2>&1 &
sleep 2
FASTDDS_PEER_AT=10.9.0.1 nsenter -t "$far" -n "$peer" play 100 2 1 /result_source/echo $type /odom $type "$messages"
