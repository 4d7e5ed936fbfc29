// A Fast DDS peer of the suite: it knows ROS 2's names and the CDR of PacejkaParams, and nothing of the suite's code.
//
//     fastdds_peer TOPIC COUNT TIMEOUT_S       subscribes to gripsight_msgs/msg/PacejkaParams, reliable and latched
//
// Prints `ready`, then one line of JSON per message, with the field names of the .msg file. Exit code 1: not all messages
// came in time. Build: c++ -std=c++14 fastdds_peer.cpp -lfastrtps -lfastcdr

#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <iomanip>
#include <iostream>
#include <sstream>
#include <string>
#include <vector>

#include <fastcdr/Cdr.h>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TopicDataType.hpp>
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>

using namespace eprosima::fastdds::dds;
using eprosima::fastrtps::rtps::SerializedPayload_t;

// Takes a sample's bytes as they are.
class RawType : public TopicDataType {
public:
    explicit RawType(const char* name) {
        setName(name);
        m_typeSize = 4096;
        m_isGetKeyDefined = false;
    }
    bool serialize(void*, SerializedPayload_t*) override { return false; }
    bool deserialize(SerializedPayload_t* payload, void* data) override {
        static_cast<std::vector<char>*>(data)->assign(payload->data, payload->data + payload->length);
        return true;
    }
    std::function<uint32_t()> getSerializedSizeProvider(void*) override {
        return [] { return 0u; };
    }
    void* createData() override { return new std::vector<char>; }
    void deleteData(void* data) override { delete static_cast<std::vector<char>*>(data); }
    bool getKey(void*, eprosima::fastrtps::rtps::InstanceHandle_t*, bool) override { return false; }
};

// Decodes CDR field by field and writes the same fields as JSON.
class Decoder {
public:
    explicit Decoder(std::vector<char>& bytes)
        : buffer_(bytes.data(), bytes.size()),
          cdr_(buffer_, eprosima::fastcdr::Cdr::DEFAULT_ENDIAN, eprosima::fastcdr::Cdr::DDS_CDR) {
        cdr_.read_encapsulation();
        out_ << std::setprecision(17);
    }

    std::string pacejka_params() {
        open();
        object("header", [this] {
            object("stamp", [this] { field<int32_t>("sec"), field<uint32_t>("nanosec"); });
            text("frame_id");
        });
        object("handshake", [this] {
            text("run_id"), field<uint64_t>("sequence_id"), field<uint32_t>("iteration");
            text("vehicle_hash"), field<uint64_t>("seed");
        });
        field<uint8_t>("status"), text("reason");
        magic_formula("front"), magic_formula("rear");
        field<double>("front_load_n"), field<double>("rear_load_n");
        interval("front_cornering_stiffness_n_per_rad"), interval("rear_cornering_stiffness_n_per_rad");
        peak("front_peak"), peak("rear_peak");
        doubles("front_slip_rad", {"low", "high"}), doubles("rear_slip_rad", {"low", "high"});
        doubles("signals", {"steering_delay_s", "steering_gain", "steering_offset_rad", "v_y_lever_arm_m",
                            "v_y_bias_mps", "yaw_rate_bias_radps"});
        field<double>("v_x_mean_mps");
        close();
        return out_.str();
    }

private:
    void magic_formula(const char* name) { doubles(name, {"b", "c", "d", "e"}); }
    void interval(const char* name) { doubles(name, {"value", "low", "high"}); }
    void peak(const char* name) {
        object(name, [this] { interval("friction"), flag("reached"), flag("from_prior"); });
    }
    void doubles(const char* name, const std::vector<const char*>& names) {
        object(name, [&] {
            for (const char* each : names) field<double>(each);
        });
    }
    template <class Body>
    void object(const char* name, Body body) {
        key(name);
        open(), body(), close();
    }
    template <class T>
    void field(const char* name) {
        T value{};
        cdr_ >> value;
        key(name);
        out_ << +value;
    }
    void flag(const char* name) {
        bool value{};
        cdr_ >> value;
        key(name);
        out_ << (value ? "true" : "false");
    }
    void text(const char* name) {
        std::string value;
        cdr_ >> value;
        key(name);
        out_ << std::quoted(value);
    }
    void key(const char* name) {
        out_ << (first_ ? "" : ",") << '"' << name << "\":";
        first_ = false;
    }
    void open() { out_ << '{', first_ = true; }
    void close() { out_ << '}', first_ = false; }

    eprosima::fastcdr::FastBuffer buffer_;
    eprosima::fastcdr::Cdr cdr_;
    std::ostringstream out_;
    bool first_ = true;
};

int main(int argc, char** argv) {
    if (argc != 4) {
        std::cerr << "usage: fastdds_peer TOPIC COUNT TIMEOUT_S\n";
        return 2;
    }
    const char* domain = std::getenv("ROS_DOMAIN_ID");
    const int count = std::atoi(argv[2]), timeout_s = std::atoi(argv[3]);

    // Loopback only, and no shared memory: the suite speaks UDP.
    DomainParticipantQos participant_qos;
    auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
    udp->interfaceWhiteList.push_back("127.0.0.1");
    participant_qos.transport().use_builtin_transports = false;
    participant_qos.transport().user_transports.push_back(udp);
    DomainParticipant* participant = DomainParticipantFactory::get_instance()->create_participant(
        domain ? std::atoi(domain) : 0, participant_qos);
    if (!participant) return 1;

    TypeSupport type(new RawType("gripsight_msgs::msg::dds_::PacejkaParams_"));
    type.register_type(participant);
    Topic* topic = participant->create_topic(std::string("rt") + argv[1], type.get_type_name(), TOPIC_QOS_DEFAULT);
    DataReaderQos qos;
    qos.reliability().kind = RELIABLE_RELIABILITY_QOS;
    qos.durability().kind = TRANSIENT_LOCAL_DURABILITY_QOS;
    qos.endpoint().history_memory_policy = eprosima::fastrtps::rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
    DataReader* reader = participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT)->create_datareader(topic, qos);
    if (!reader) return 1;
    std::cout << "ready" << std::endl;

    int received = 0;
    while (received < count && reader->wait_for_unread_message({timeout_s, 0})) {
        std::vector<char> sample;
        SampleInfo info;
        if (reader->take_next_sample(&sample, &info) == ReturnCode_t::RETCODE_OK && info.valid_data) {
            std::cout << Decoder(sample).pacejka_params() << std::endl;
            ++received;
        }
    }
    // The process ends here: tearing the entities down one by one would only take time.
    std::cout.flush();
    std::_Exit(received == count ? 0 : 1);
}
