// A peer on CycloneDDS 0.10 in C, the version that ROS 2 Jazzy ships: it drops fragments that are not padded, which
// the newer one behind cyclone_peer.py takes.
//
//     cyclone_peer TOPIC COUNT TIMEOUT_S       subscribes to sensor_msgs/msg/CompressedImage, reliable
//
// Prints `ready`, then length and sum of the bytes of each picture. Exit code 1: not all came in time.
// Build: idlc compressed_image.idl; cc cyclone_peer.c compressed_image.c -lddsc

#include <stdio.h>
#include <stdlib.h>

#include "compressed_image.h"
#include "dds/dds.h"

int main(int argc, char** argv) {
    if (argc != 4) {
        fprintf(stderr, "usage: cyclone_peer TOPIC COUNT TIMEOUT_S\n");
        return 2;
    }
    const char* domain = getenv("ROS_DOMAIN_ID");
    const int count = atoi(argv[2]);
    const dds_time_t end = dds_time() + DDS_SECS(atoi(argv[3]));
    char name[256];
    snprintf(name, sizeof name, "rt%s", argv[1]);

    const dds_entity_t participant = dds_create_participant(domain ? (dds_domainid_t)atoi(domain) : 0, NULL, NULL);
    const dds_entity_t topic =
        dds_create_topic(participant, &sensor_msgs_msg_dds__CompressedImage__desc, name, NULL, NULL);
    dds_qos_t* qos = dds_create_qos();
    dds_qset_reliability(qos, DDS_RELIABILITY_RELIABLE, DDS_SECS(1));
    dds_qset_history(qos, DDS_HISTORY_KEEP_LAST, 100);
    const dds_entity_t reader = dds_create_reader(participant, topic, qos, NULL);
    dds_delete_qos(qos);
    if (reader < 0) {
        fprintf(stderr, "cannot subscribe: %s\n", dds_strretcode(reader));
        return 1;
    }
    printf("ready\n");
    fflush(stdout);

    int received = 0;
    while (received < count && dds_time() < end) {
        void* sample = NULL;
        dds_sample_info_t info;
        if (dds_take(reader, &sample, &info, 1, 1) > 0) {
            if (info.valid_data) {
                const sensor_msgs_msg_dds__CompressedImage_* picture = sample;
                unsigned long sum = 0;
                for (uint32_t index = 0; index < picture->data._length; ++index) sum += picture->data._buffer[index];
                printf("%u %lu\n", picture->data._length, sum);
                fflush(stdout);
                ++received;
            }
            dds_return_loan(reader, &sample, 1);
        } else {
            dds_sleepfor(DDS_MSECS(5));
        }
    }
    dds_delete(participant);
    return received == count ? 0 : 1;
}
