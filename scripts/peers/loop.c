/* loop.c: the smallest master of the same exchange: SYNC, the positions of six drives, torques clamp(-q/8), in C.
 *
 * usage: loop INTERFACE PERIOD_US grouped|per-drive plain|guarded|drained SECONDS
 *
 * plain    blocking reads; what is lost, late or old is not noticed
 * guarded  what the node does for each frame: a wait with a deadline, the kernel's receive stamp, the clock before each torque, and
 *          the transmit confirmation of SYNC by a second socket
 * drained  as guarded, but it sleeps until the earliest time at which all samples were there in its first 200 cycles, and then
 *          reads without waiting what is there
 *
 * No boot, no power stage, no heartbeat, no watch, no controller, no log. The drives must be configured and operational.
 */
#define _GNU_SOURCE
#include <errno.h>
#include <linux/can.h>
#include <linux/can/raw.h>
#include <net/if.h>
#include <poll.h>
#include <sched.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/ioctl.h>
#include <sys/mman.h>
#include <sys/socket.h>
#include <sys/uio.h>
#include <time.h>
#include <unistd.h>

#define DRIVES 6
#define OBSERVED_CYCLES 200

static void fail(const char *what) {
  perror(what);
  exit(1);
}

static int64_t now(clockid_t clock) {
  struct timespec time;
  clock_gettime(clock, &time);
  return (int64_t)time.tv_sec * 1000000000 + time.tv_nsec;
}

/* Opens a raw socket that receives the COB-IDs from `first` to `last`. */
static int open_socket(const char *interface, unsigned first, unsigned last) {
  int fd = socket(PF_CAN, SOCK_RAW | SOCK_CLOEXEC, CAN_RAW);
  struct ifreq request = {0};
  struct sockaddr_can address = {.can_family = AF_CAN};
  struct can_filter filters[DRIVES];
  unsigned count = 0;
  if (fd < 0) fail("socket");
  for (unsigned id = first; id <= last; id++)
    filters[count++] = (struct can_filter){id, CAN_SFF_MASK | CAN_EFF_FLAG | CAN_RTR_FLAG};
  if (setsockopt(fd, SOL_CAN_RAW, CAN_RAW_FILTER, filters, count * sizeof *filters)) fail("filter");
  strncpy(request.ifr_name, interface, IFNAMSIZ - 1);
  if (ioctl(fd, SIOCGIFINDEX, &request)) fail(interface);
  address.can_ifindex = request.ifr_ifindex;
  if (bind(fd, (struct sockaddr *)&address, sizeof address)) fail("bind");
  return fd;
}

/* Reads a frame with its receive stamp on the wall clock. */
static int read_stamped(int fd, struct can_frame *frame, int64_t *stamp, int flags) {
  char control[CMSG_SPACE(sizeof(struct timespec))];
  struct iovec part = {frame, sizeof *frame};
  struct msghdr message = {.msg_iov = &part, .msg_iovlen = 1, .msg_control = control, .msg_controllen = sizeof control};
  if (recvmsg(fd, &message, flags) < (ssize_t)sizeof *frame) return 0;
  for (struct cmsghdr *it = CMSG_FIRSTHDR(&message); it; it = CMSG_NXTHDR(&message, it))
    if (it->cmsg_type == SO_TIMESTAMPNS) {
      struct timespec time;
      memcpy(&time, CMSG_DATA(it), sizeof time);
      *stamp = (int64_t)time.tv_sec * 1000000000 + time.tv_nsec;
    }
  return 1;
}

static int16_t torque(int32_t position) {
  int32_t value = -position / 8;
  return (int16_t)(value > 1000 ? 1000 : value < -1000 ? -1000 : value);
}

int main(int count, char **words) {
  if (count != 6) {
    fprintf(stderr, "usage: loop INTERFACE PERIOD_US grouped|per-drive plain|guarded|drained SECONDS\n");
    return 2;
  }
  const int64_t period = atoll(words[2]) * 1000;
  const int is_grouped = !strcmp(words[3], "grouped"), is_guarded = strcmp(words[4], "plain"), is_drained = !strcmp(words[4], "drained");
  const int64_t cycles = atoll(words[5]) * 1000000000 / period;
  const int on = 1, fd = open_socket(words[1], 0x181, 0x186), witness = is_guarded ? open_socket(words[1], 0x80, 0x80) : -1;
  /* A statusword (6041h) precedes the position where one TPDO has both. */
  const int offset = is_grouped ? 0 : 2;
  struct sched_param priority = {.sched_priority = 80};
  int64_t missed = 0, late = 0, unconfirmed = 0, earliest = period / 2;
  if (is_guarded && (setsockopt(fd, SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on) ||
                     setsockopt(witness, SOL_SOCKET, SO_TIMESTAMPNS, &on, sizeof on)))
    fail("stamps");
  if (mlockall(MCL_CURRENT | MCL_FUTURE) || sched_setscheduler(0, SCHED_FIFO, &priority)) fail("real time");
  const struct can_frame start = {.can_id = 0, .can_dlc = 2, .data = {1, 0}};
  if (write(fd, &start, sizeof start) < 0) fail("start");
  int64_t due = now(CLOCK_MONOTONIC) + period;
  for (int64_t cycle = 0; cycle < cycles; cycle++, due += period) {
    const struct timespec at = {due / 1000000000, due % 1000000000};
    const struct can_frame sync = {.can_id = 0x80};
    int32_t positions[DRIVES] = {0};
    unsigned seen = 0, may_wait = 1;
    int64_t last = 0;
    while (clock_nanosleep(CLOCK_MONOTONIC, TIMER_ABSTIME, &at, NULL) == EINTR) {}
    const int64_t sent_at = is_guarded ? now(CLOCK_BOOTTIME) : 0;
    if (write(fd, &sync, sizeof sync) < 0) fail("SYNC");
    if (is_drained && cycle > OBSERVED_CYCLES) {
      const int64_t until = sent_at + earliest;
      const struct timespec then = {until / 1000000000, until % 1000000000};
      while (clock_nanosleep(CLOCK_BOOTTIME, TIMER_ABSTIME, &then, NULL) == EINTR) {}
      may_wait = 0;
    }
    while (seen != (1u << DRIVES) - 1) {
      struct can_frame frame;
      int64_t stamp = 0;
      if (is_guarded) {
        const int64_t left = sent_at + period / 2 - now(CLOCK_BOOTTIME);
        const struct timespec timeout = {0, left > 0 ? left : 0};
        struct pollfd waits = {fd, POLLIN, 0};
        if (may_wait && ppoll(&waits, 1, &timeout, NULL) <= 0) break;
        if (!read_stamped(fd, &frame, &stamp, MSG_DONTWAIT)) {
          may_wait = 1;
          continue;
        }
        stamp += now(CLOCK_BOOTTIME) - now(CLOCK_REALTIME);
        /* Came before this SYNC: of the cycle before. */
        if (stamp < sent_at) continue;
        last = stamp;
      } else if (read(fd, &frame, sizeof frame) < 0) {
        fail("read");
      }
      memcpy(&positions[frame.can_id - 0x181], frame.data + offset, sizeof *positions);
      seen |= 1u << (frame.can_id - 0x181);
    }
    missed += seen != (1u << DRIVES) - 1;
    if (is_drained && cycle > 0 && cycle <= OBSERVED_CYCLES && last && last - sent_at < earliest) earliest = last - sent_at;
    for (unsigned drive = 0; drive < DRIVES; drive += is_grouped ? 3 : 1) {
      struct can_frame frame = {.can_id = 0x201 + drive, .can_dlc = is_grouped ? 6 : 4};
      for (unsigned one = 0; one < (is_grouped ? 3u : 1u); one++) {
        const int16_t value = torque(positions[drive + one]);
        memcpy(frame.data + (is_grouped ? 2 * one : 2), &value, sizeof value);
      }
      if (is_guarded && now(CLOCK_BOOTTIME) - sent_at > period + period / 2) {
        late++;
        continue;
      }
      if (write(fd, &frame, sizeof frame) < 0) fail("RPDO");
    }
    if (is_guarded) {
      struct can_frame frame;
      int64_t stamp = 0;
      unconfirmed += !read_stamped(witness, &frame, &stamp, MSG_DONTWAIT);
    }
  }
  printf("loop: %lld cycles, %lld without all samples, %lld late torques, %lld unconfirmed\n", (long long)cycles,
         (long long)missed, (long long)late, (long long)unconfirmed);
  return 0;
}
