/* lely.cpp: the exchange of loop.c by the C++ master of lely-core 2.x (liblely-coapp).
 *
 * usage: lely INTERFACE PERIOD_US grouped|per-drive DCF SECONDS
 *
 * AsyncMaster with an object dictionary, which this program writes to the file DCF: SYNC by 1005h and 1006h, the positions of six drives
 * by RPDOs, torques clamp(-q/8) by event-driven TPDOs. A cycle without all samples has no torques. SIGALRM ends it after SECONDS.
 *
 * No boot, no power stage, no heartbeat, no watch, no controller, no log. The drives must be configured.
 *
 * 1F80h is absent, so AsyncMaster is no NMT master: that would first reset the communication of all nodes, and so the drives' PDO
 * parameters. This program sends the NMT start.
 */
#include <sys/mman.h>
#include <unistd.h>

#include <cerrno>
#include <cinttypes>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <ctime>
#include <exception>
#include <string>
#include <system_error>
#include <vector>

#include <lely/coapp/master.hpp>
#include <lely/ev/loop.hpp>
#include <lely/io2/ctx.hpp>
#include <lely/io2/linux/can.hpp>
#include <lely/io2/posix/poll.hpp>
#include <lely/io2/sys/io.hpp>
#include <lely/io2/sys/timer.hpp>

namespace {

constexpr unsigned DRIVES = 6;
/* Not the node-ID of `frhc run`, whose heartbeat the drives consume. */
constexpr std::uint8_t NODE_ID = 126;

enum Type : unsigned { INTEGER16 = 3, INTEGER32 = 4, UNSIGNED8 = 5, UNSIGNED16 = 6, UNSIGNED32 = 7 };

/* Arrays of the master's dictionary, with the drive's node-ID as sub-index. */
enum Array : std::uint16_t { STATUSWORDS = 0x2001, POSITIONS = 0x2002, TORQUES_ACTUAL = 0x2003, CONTROLWORDS = 0x2004, TARGETS = 0x2005 };

std::uint32_t mapped(Array array, unsigned drive, unsigned bits) { return std::uint32_t{array} << 16 | drive << 8 | bits; }

/* Writes a DCF (CiA 306). */
class Dcf {
 public:
  explicit Dcf(const char *path) : file_(std::fopen(path, "w")) {
    if (!file_) throw std::system_error(errno, std::generic_category(), path);
    std::fprintf(file_, "[DeviceInfo]\nVendorName=frhc\n\n");
  }
  Dcf(const Dcf &) = delete;
  Dcf &operator=(const Dcf &) = delete;
  ~Dcf() {
    list("MandatoryObjects", mandatory_);
    list("OptionalObjects", optional_);
    list("ManufacturerObjects", manufacturer_);
    std::fclose(file_);
  }

  void variable(unsigned index, Type type, std::uint32_t value) {
    begin(index);
    std::fprintf(file_, "DataType=0x%04X\nAccessType=rw\nDefaultValue=0x%" PRIX32 "\n\n", type, value);
  }

  /* Adds an array of zeros that PDOs may map. */
  void array(unsigned index, Type type) {
    begin(index);
    std::fprintf(file_, "ObjectType=0x08\nDataType=0x%04X\nAccessType=rw\nPDOMapping=1\nCompactSubObj=%u\n\n", type, DRIVES);
  }

  void numbers(unsigned index, const std::vector<std::uint32_t> &values) {
    begin(index);
    std::fprintf(file_, "ObjectType=0x09\nDataType=0x%04X\nAccessType=rw\nCompactSubObj=%zu\n\n", UNSIGNED32, values.size());
    std::fprintf(file_, "[%XValue]\nNrOfEntries=%zu\n", index, values.size());
    for (std::size_t sub = 0; sub < values.size(); sub++) std::fprintf(file_, "%zu=0x%08" PRIX32 "\n", sub + 1, values[sub]);
    std::fprintf(file_, "\n");
  }

  /* Adds an event-driven PDO: its communication parameters at `index`, its mapping at `index` + 200h. */
  void pdo(unsigned index, std::uint32_t cob_id, const std::vector<std::uint32_t> &mapping) {
    begin(index);
    std::fprintf(file_, "ObjectType=0x09\nSubNumber=3\n\n");
    sub(index, 0, UNSIGNED8, 2);
    sub(index, 1, UNSIGNED32, cob_id);
    sub(index, 2, UNSIGNED8, 0xFF);
    numbers(index + 0x200, mapping);
  }

 private:
  void begin(unsigned index) {
    const bool is_mandatory = index == 0x1000 || index == 0x1001 || index == 0x1018;
    (is_mandatory ? mandatory_ : index < 0x2000 ? optional_ : manufacturer_).push_back(index);
    std::fprintf(file_, "[%X]\nParameterName=%Xh\n", index, index);
  }

  void sub(unsigned index, unsigned sub, Type type, std::uint32_t value) {
    std::fprintf(file_, "[%Xsub%X]\nParameterName=%Xh:%X\nDataType=0x%04X\nAccessType=rw\nDefaultValue=0x%" PRIX32 "\n\n", index, sub,
                 index, sub, type, value);
  }

  void list(const char *section, const std::vector<unsigned> &indices) {
    std::fprintf(file_, "[%s]\nSupportedObjects=%zu\n", section, indices.size());
    for (std::size_t place = 0; place < indices.size(); place++) std::fprintf(file_, "%zu=0x%04X\n", place + 1, indices[place]);
    std::fprintf(file_, "\n");
  }

  std::FILE *file_;
  std::vector<unsigned> mandatory_, optional_, manufacturer_;
};

void write_dictionary(const char *path, std::uint32_t period_us, bool is_grouped) {
  Dcf dcf(path);
  dcf.variable(0x1000, UNSIGNED32, 0);
  dcf.variable(0x1001, UNSIGNED8, 0);
  dcf.numbers(0x1018, {0, 0, 0, 0});
  /* Bit 30: this node produces SYNC. */
  dcf.variable(0x1005, UNSIGNED32, 0x40000080);
  dcf.variable(0x1006, UNSIGNED32, period_us);
  dcf.array(STATUSWORDS, UNSIGNED16);
  dcf.array(POSITIONS, INTEGER32);
  dcf.array(TORQUES_ACTUAL, INTEGER16);
  dcf.array(CONTROLWORDS, UNSIGNED16);
  dcf.array(TARGETS, INTEGER16);
  for (unsigned drive = 1; drive <= DRIVES; drive++) {
    const std::uint32_t position = mapped(POSITIONS, drive, 32);
    dcf.pdo(0x1400 + drive - 1, 0x180 + drive,
            is_grouped ? std::vector<std::uint32_t>{position}
                       : std::vector<std::uint32_t>{mapped(STATUSWORDS, drive, 16), position, mapped(TORQUES_ACTUAL, drive, 16)});
  }
  unsigned number = 0;
  for (unsigned drive = 1; drive <= DRIVES; drive += is_grouped ? 3 : 1, number++) {
    const std::uint32_t target = mapped(TARGETS, drive, 16);
    /* Bit 30: no remote frames. */
    dcf.pdo(0x1800 + number, 0x40000200 + drive,
            is_grouped ? std::vector<std::uint32_t>{target, mapped(TARGETS, drive + 1, 16), mapped(TARGETS, drive + 2, 16)}
                       : std::vector<std::uint32_t>{mapped(CONTROLWORDS, drive, 16), target});
  }
}

std::int16_t torque(std::int32_t position) {
  const std::int32_t value = -position / 8;
  return static_cast<std::int16_t>(value > 1000 ? 1000 : value < -1000 ? -1000 : value);
}

class Master : public lely::canopen::AsyncMaster {
 public:
  Master(lely::io::TimerBase &timer, lely::io::CanChannelBase &channel, const std::string &dcf, bool is_grouped)
      : AsyncMaster(timer, channel, dcf, "", NODE_ID), tpdos_(is_grouped ? 2 : DRIVES) {}

 private:
  void OnSync(std::uint8_t, const time_point &) noexcept override { seen_ = 0; }

  /* lely calls this with the master locked, after the RPDO is in the dictionary. Get, Set and Node's TpdoEvent do not lock it. */
  void OnRpdo(int number, std::error_code error, const void *, std::size_t) noexcept override {
    if (error) return;
    seen_ |= 1u << (number - 1);
    if (seen_ != (1u << DRIVES) - 1) return;
    seen_ = 0;
    std::error_code failed;
    for (unsigned drive = 1; drive <= DRIVES; drive++) {
      const std::int32_t position = Get<std::int32_t>(POSITIONS, drive, failed);
      Set<std::int16_t>(TARGETS, drive, torque(position), failed);
    }
    for (unsigned tpdo = 1; tpdo <= tpdos_; tpdo++) Node::TpdoEvent(tpdo);
  }

  unsigned tpdos_;
  unsigned seen_{0};
};

}  // namespace

int main(int count, char **words) {
  if (count != 6) {
    std::fprintf(stderr, "usage: lely INTERFACE PERIOD_US grouped|per-drive DCF SECONDS\n");
    return 2;
  }
  const bool is_grouped = !std::strcmp(words[3], "grouped");
  try {
    write_dictionary(words[4], static_cast<std::uint32_t>(std::atol(words[2])), is_grouped);
    alarm(static_cast<unsigned>(std::atoi(words[5])));
    lely::io::IoGuard guard;
    lely::io::Context context;
    lely::io::Poll poll(context);
    lely::ev::Loop loop(poll.get_poll());
    auto executor = loop.get_executor();
    lely::io::Timer timer(poll, executor, CLOCK_MONOTONIC);
    lely::io::CanController controller(words[1]);
    lely::io::CanChannel channel(poll, executor);
    channel.open(controller);
    /* NMT start of all nodes, before the master has the channel. */
    can_msg start = CAN_MSG_INIT;
    start.len = 2;
    start.data[0] = 1;
    channel.write(start);
    Master master(timer, channel, words[4], is_grouped);
    if (mlockall(MCL_CURRENT | MCL_FUTURE)) throw std::system_error(errno, std::generic_category(), "mlockall");
    master.Reset();
    loop.run();
  } catch (const std::exception &error) {
    std::fprintf(stderr, "lely: %s\n", error.what());
    return 1;
  }
  return 0;
}
