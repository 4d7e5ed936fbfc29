// A Fast DDS peer of the suite: it knows ROS 2's names and the CDR of PacejkaParams, and nothing of the suite's code.
//
//     fastdds_peer TOPIC COUNT TIMEOUT_S        subscribes to gripsight_msgs/msg/PacejkaParams, reliable and latched
//     fastdds_peer get NODE PARAMETER TIMEOUT_S  asks a node for an integer parameter, as rmw_fastrtps does
//
// Prints `ready`, then one line of JSON per message, with the field names of the .msg file. Exit code 1: not all messages
// came in time. Build: c++ -std=c++14 fastdds_peer.cpp -lfastrtps -lfastcdr

#include <chrono>
#include <cstdlib>
#include <cstring>
#include <iomanip>
#include <iostream>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include <fastcdr/Cdr.h>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
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
    bool serialize(void* data, SerializedPayload_t* payload) override {
        const auto& bytes = *static_cast<std::vector<char>*>(data);
        payload->encapsulation = CDR_LE;
        payload->length = bytes.size();
        std::memcpy(payload->data, bytes.data(), bytes.size());
        return true;
    }
    bool deserialize(SerializedPayload_t* payload, void* data) override {
        static_cast<std::vector<char>*>(data)->assign(payload->data, payload->data + payload->length);
        return true;
    }
    std::function<uint32_t()> getSerializedSizeProvider(void* data) override {
        return [data] { return static_cast<uint32_t>(static_cast<std::vector<char>*>(data)->size()); };
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
        field<double>("front_valid_slip_rad"), field<double>("rear_valid_slip_rad");
        field<double>("front_valid_force_n"), field<double>("rear_valid_force_n");
        doubles("signals", {"steering_delay_s", "steering_gain", "steering_offset_rad", "v_y_lever_arm_m",
                            "v_y_bias_mps", "yaw_rate_bias_radps"});
        field<double>("v_x_mean_mps");
        object("longitudinal", [this] {
            interval("gain"), interval("delay_s"), interval("lag_s");
            interval("rolling_resistance_mps2"), interval("drag_1pm");
            list("limits", [this] {
                doubles("v_x_mps", {"low", "high"});
                field<double>("a_max_mps2"), flag("a_max_reached");
                field<double>("a_min_mps2"), flag("a_min_reached");
            });
        });
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
    template <class Body>
    void list(const char* name, Body body) {
        uint32_t count{};
        cdr_ >> count;
        key(name);
        out_ << '[';
        for (uint32_t k = 0; k < count; ++k) {
            if (k > 0) out_ << ',';
            open(), body(), close();
        }
        out_ << ']';
        first_ = false;
    }
    template <class T>
    void field(const char* name) {
        T value{};
        cdr_ >> value;
        key(name);
        // As Python writes it.
        if (value != value) out_ << "NaN";
        else out_ << +value;
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

// Loopback only, and no shared memory: the suite speaks UDP.
DomainParticipant* join() {
    const char* domain = std::getenv("ROS_DOMAIN_ID");
    DomainParticipantQos qos;
    auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
    udp->interfaceWhiteList.push_back("127.0.0.1");
    qos.transport().use_builtin_transports = false;
    qos.transport().user_transports.push_back(udp);
    return DomainParticipantFactory::get_instance()->create_participant(domain ? std::atoi(domain) : 0, qos);
}

Topic* topic(DomainParticipant* participant, const std::string& name, const char* type_name) {
    TypeSupport type(new RawType(type_name));
    type.register_type(participant);
    return participant->create_topic(name, type_name, TOPIC_QOS_DEFAULT);
}

DataReader* reader(DomainParticipant* participant, Topic* topic, DurabilityQosPolicyKind durability) {
    DataReaderQos qos;
    qos.reliability().kind = RELIABLE_RELIABILITY_QOS;
    qos.durability().kind = durability;
    qos.endpoint().history_memory_policy = eprosima::fastrtps::rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
    return participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT)->create_datareader(topic, qos);
}

bool subscribe(const std::string& name, int count, int timeout_s) {
    DomainParticipant* participant = join();
    DataReader* results =
        reader(participant, topic(participant, "rt" + name, "gripsight_msgs::msg::dds_::PacejkaParams_"),
               TRANSIENT_LOCAL_DURABILITY_QOS);
    std::cout << "ready" << std::endl;
    int received = 0;
    while (received < count && results->wait_for_unread_message({timeout_s, 0})) {
        std::vector<char> sample;
        SampleInfo info;
        if (results->take_next_sample(&sample, &info) == ReturnCode_t::RETCODE_OK && info.valid_data) {
            std::cout << Decoder(sample).pacejka_params() << std::endl;
            ++received;
        }
    }
    return received == count;
}

// The request names the reply's reader as related identity; the reply names it and the request's number.
bool get(const std::string& node, const std::string& parameter, int timeout_s) {
    DomainParticipant* participant = join();
    DataReader* replies = reader(participant,
                                 topic(participant, "rr" + node + "/get_parametersReply",
                                       "rcl_interfaces::srv::dds_::GetParameters_Response_"),
                                 VOLATILE_DURABILITY_QOS);
    DataWriter* requests = participant->create_publisher(PUBLISHER_QOS_DEFAULT)
                               ->create_datawriter(topic(participant, "rq" + node + "/get_parametersRequest",
                                                         "rcl_interfaces::srv::dds_::GetParameters_Request_"),
                                                   DATAWRITER_QOS_DEFAULT);
    PublicationMatchedStatus heard;
    SubscriptionMatchedStatus hears;
    for (int wait = 0; wait < 100 * timeout_s; ++wait) {
        requests->get_publication_matched_status(heard);
        replies->get_subscription_matched_status(hears);
        if (heard.current_count > 0 && hears.current_count > 0) break;
        std::this_thread::sleep_for(std::chrono::milliseconds(10));
    }

    std::vector<char> request(512);
    eprosima::fastcdr::FastBuffer buffer(request.data(), request.size());
    eprosima::fastcdr::Cdr out(buffer, eprosima::fastcdr::Cdr::DEFAULT_ENDIAN, eprosima::fastcdr::Cdr::DDS_CDR);
    out.serialize_encapsulation();
    out << std::vector<std::string>{parameter};
    request.resize(out.getSerializedDataLength());
    eprosima::fastrtps::rtps::WriteParams identity;
    identity.related_sample_identity().writer_guid() = replies->guid();
    requests->write(&request, identity);

    while (replies->wait_for_unread_message({timeout_s, 0})) {
        std::vector<char> reply;
        SampleInfo info;
        if (replies->take_next_sample(&reply, &info) != ReturnCode_t::RETCODE_OK || !info.valid_data) continue;
        if (info.related_sample_identity.writer_guid() != replies->guid() ||
            info.related_sample_identity.sequence_number() != identity.sample_identity().sequence_number())
            continue;
        eprosima::fastcdr::FastBuffer answer(reply.data(), reply.size());
        eprosima::fastcdr::Cdr in(answer, eprosima::fastcdr::Cdr::DEFAULT_ENDIAN, eprosima::fastcdr::Cdr::DDS_CDR);
        in.read_encapsulation();
        uint32_t values;
        uint8_t type;
        bool flag;
        int64_t integer;
        in >> values >> type >> flag >> integer;
        std::cout << values << ' ' << +type << ' ' << integer << std::endl;
        return true;
    }
    return false;
}

int main(int argc, char** argv) {
    bool done = false;
    if (argc == 4) {
        done = subscribe(argv[1], std::atoi(argv[2]), std::atoi(argv[3]));
    } else if (argc == 5 && std::string(argv[1]) == "get") {
        done = get(argv[2], argv[3], std::atoi(argv[4]));
    } else {
        std::cerr << "usage: fastdds_peer TOPIC COUNT TIMEOUT_S | get NODE PARAMETER TIMEOUT_S\n";
        return 2;
    }
    // The process ends here: tearing the entities down one by one would only take time.
    std::cout.flush();
    std::_Exit(done ? 0 : 1);
}
