// A Fast DDS peer of the suite: it knows ROS 2's names and the CDR of PacejkaParams, and nothing of the suite's code.
//
//     fastdds_peer TOPIC COUNT TIMEOUT_S        subscribes to gripsight_msgs/msg/PacejkaParams, reliable and latched
//     fastdds_peer get NODE PARAMETER TIMEOUT_S  asks a node for an integer parameter, as rmw_fastrtps does
//     fastdds_peer play HZ SECONDS READERS ANSWERS TYPE (TOPIC TYPE FILE)...
//         writes prepared messages, best effort, over and over, and times the answers that bear their stamps; see `play`
//
// Prints `ready`, then one line of JSON per message, with the field names of the .msg file. Exit code 1: not all messages
// came in time. Build: c++ -std=c++14 fastdds_peer.cpp -pthread -lfastrtps -lfastcdr

#include <atomic>
#include <chrono>
#include <cstdlib>
#include <cstring>
#include <fstream>
#include <iomanip>
#include <iostream>
#include <map>
#include <mutex>
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
#include <fastrtps/utils/IPLocator.h>

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

// Loopback only, and no shared memory: the suite speaks UDP. With FASTDDS_PEER_AT the machine of that address is asked for its participants, too.
DomainParticipant* join() {
    const char* domain = std::getenv("ROS_DOMAIN_ID");
    DomainParticipantQos qos;
    auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
    const int id = domain ? std::atoi(domain) : 0;
    if (const char* address = std::getenv("FASTDDS_PEER_AT")) {
        for (int participant = 0; participant < 4; ++participant) {
            eprosima::fastrtps::rtps::Locator_t at;
            eprosima::fastrtps::rtps::IPLocator::setIPv4(at, address);
            at.port = 7400 + 250 * id + 10 + 2 * participant;
            qos.wire_protocol().builtin.initialPeersList.push_back(at);
        }
    } else {
        udp->interfaceWhiteList.push_back("127.0.0.1");
    }
    qos.transport().use_builtin_transports = false;
    qos.transport().user_transports.push_back(udp);
    return DomainParticipantFactory::get_instance()->create_participant(id, qos);
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
    // By default a sample that comes before the one before it was taken takes its place.
    qos.history().depth = 1000;
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

double now_s() {
    return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

// The type's name as DDS has it: gripsight_msgs/msg/Residual is gripsight_msgs::msg::dds_::Residual_.
std::string mangled(const std::string& name) {
    const size_t package = name.find('/'), type = name.rfind('/');
    return name.substr(0, package) + "::" + name.substr(package + 1, type - package - 1) + "::dds_::" + name.substr(type + 1) + "_";
}

// A file of prepared messages (their length in four bytes, then CDR with its encapsulation and a header first), and their writer.
struct Source {
    DataWriter* writer;
    std::vector<std::vector<char>> messages;

    Source(DomainParticipant* participant, const std::string& name, const std::string& type, const char* path) {
        std::ifstream file(path, std::ios::binary);
        for (uint32_t length; file.read(reinterpret_cast<char*>(&length), 4);) {
            messages.emplace_back(length);
            file.read(messages.back().data(), length);
        }
        DataWriterQos qos;
        qos.reliability().kind = BEST_EFFORT_RELIABILITY_QOS;
        qos.history().depth = 50;
        qos.endpoint().history_memory_policy = eprosima::fastrtps::rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
        writer = participant->create_publisher(PUBLISHER_QOS_DEFAULT)
                     ->create_datawriter(topic(participant, "rt" + name, mangled(type).c_str()), qos);
    }

    void write(uint64_t index, int64_t stamp_ns) {
        auto& message = messages[index % messages.size()];
        const int32_t seconds = stamp_ns / 1000000000;
        const uint32_t rest = stamp_ns % 1000000000;
        std::memcpy(message.data() + 4, &seconds, 4);
        std::memcpy(message.data() + 8, &rest, 4);
        writer->write(&message);
    }
};

// Writes a message of each topic at each step, stamped every 1 / HZ s; the last topic's is timed against the answer that bears its stamp. Starts
// once every topic has READERS readers, counts from the first answer on (which has a minute to come), for SECONDS. Prints `first S`, then
// a line `LATE_S` of each step before it, `LATE_S WRITTEN_S ARRIVED_S` of each counted one, - for what never arrived.
bool play(double hz, double seconds, int readers, const std::string& answers, const std::string& type, char** sources, int count) {
    const double discovery_s = 20.0, prepared_s = 60.0, tail_s = 1.0;
    DomainParticipant* participant = join();
    std::vector<Source> topics;
    for (int k = 0; k + 2 < count; k += 3) topics.emplace_back(participant, sources[k], sources[k + 1], sources[k + 2]);
    for (const Source& each : topics)
        if (each.messages.empty()) return false;
    DataReader* reads = reader(participant, topic(participant, "rt" + answers, mangled(type).c_str()), VOLATILE_DURABILITY_QOS);
    std::cout << "ready" << std::endl;

    const auto is_heard = [&](const Source& each) {
        PublicationMatchedStatus status;
        each.writer->get_publication_matched_status(status);
        return status.current_count >= readers;
    };
    for (const Source& each : topics) {
        for (const double end = now_s() + discovery_s; !is_heard(each);) {
            if (now_s() > end) return false;
            std::this_thread::sleep_for(std::chrono::milliseconds(10));
        }
    }

    std::map<int64_t, double> arrived;
    std::mutex lock;
    std::atomic<bool> any{false}, running{true};
    std::thread listener([&] {
        while (running) {
            if (!reads->wait_for_unread_message({0, 100000000})) continue;
            std::vector<char> sample;
            SampleInfo info;
            while (reads->take_next_sample(&sample, &info) == ReturnCode_t::RETCODE_OK) {
                const double at = now_s();
                if (!info.valid_data || sample.size() < 12) continue;
                int32_t whole;
                uint32_t rest;
                std::memcpy(&whole, sample.data() + 4, 4);
                std::memcpy(&rest, sample.data() + 8, 4);
                std::lock_guard<std::mutex> held(lock);
                arrived.emplace(int64_t{whole} * 1000000000 + rest, at);
                any = true;
            }
        }
    });

    struct Step {
        int64_t stamp_ns;
        double late_s, written_s;
        bool counts;
    };
    std::vector<Step> steps;
    const auto begun = std::chrono::steady_clock::now();
    const double begun_s = now_s();
    const int64_t begun_ns = std::chrono::duration_cast<std::chrono::nanoseconds>(
        std::chrono::system_clock::now().time_since_epoch()).count();
    double end_s = 0.0;
    bool is_done = true;
    for (uint64_t index = 0; end_s == 0.0 || now_s() < end_s; ++index) {
        const double due_s = index / hz;
        std::this_thread::sleep_until(begun + std::chrono::nanoseconds(static_cast<int64_t>(1e9 * due_s)));
        const double late_s = now_s() - begun_s - due_s;
        const int64_t stamp_ns = begun_ns + static_cast<int64_t>(1e9 * due_s);
        for (size_t k = 0; k + 1 < topics.size(); ++k) topics[k].write(index, stamp_ns);
        const double written_s = now_s();
        topics.back().write(index, stamp_ns);
        if (any && end_s == 0.0) {
            end_s = now_s() + seconds;
            std::cout << "first " << now_s() - begun_s << std::endl;
        }
        if (end_s == 0.0 && due_s > prepared_s) {
            is_done = false;
            break;
        }
        steps.push_back({stamp_ns, late_s, written_s, end_s > 0.0});
    }
    std::this_thread::sleep_for(std::chrono::duration<double>(tail_s));
    running = false;
    listener.join();
    std::cout << std::fixed << std::setprecision(9);
    for (const Step& step : steps) {
        std::cout << step.late_s;
        if (step.counts) {
            const auto answer = arrived.find(step.stamp_ns);
            std::cout << ' ' << step.written_s << ' ';
            if (answer == arrived.end()) std::cout << '-';
            else std::cout << answer->second;
        }
        std::cout << '\n';
    }
    return is_done;
}

int main(int argc, char** argv) {
    bool done = false;
    if (argc >= 10 && argc % 3 == 1 && std::string(argv[1]) == "play") {
        done = play(std::atof(argv[2]), std::atof(argv[3]), std::atoi(argv[4]), argv[5], argv[6], argv + 7, argc - 7);
    } else if (argc == 4) {
        done = subscribe(argv[1], std::atoi(argv[2]), std::atoi(argv[3]));
    } else if (argc == 5 && std::string(argv[1]) == "get") {
        done = get(argv[2], argv[3], std::atoi(argv[4]));
    } else {
        std::cerr << "usage: fastdds_peer TOPIC COUNT TIMEOUT_S | get NODE PARAMETER TIMEOUT_S\n"
                     "       | play HZ SECONDS READERS ANSWERS TYPE (TOPIC TYPE FILE)...\n";
        return 2;
    }
    // The process ends here: tearing the entities down one by one would only take time.
    std::cout.flush();
    std::_Exit(done ? 0 : 1);
}
