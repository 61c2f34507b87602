/* Reads lines "device HEX" or "host HEX" (who the frame is for) and prints what each frame says, or "refused". */
#include "gonio_wire.h"

#include <inttypes.h>
#include <stdarg.h>
#include <stdio.h>
#include <string.h>

static char text[2048];
static size_t text_len;

static void say(const char *format, ...)
{
    va_list args;
    int n;
    va_start(args, format);
    n = vsnprintf(text + text_len, sizeof text - text_len, format, args);
    va_end(args);
    if (n > 0 && (size_t)n < sizeof text - text_len)
        text_len += (size_t)n;
}

static void field_u32(struct gonio_reader *r, const char *name) { say("%s: %" PRIu32, name, gonio_u32(r)); }
static void field_i32(struct gonio_reader *r, const char *name) { say("%s: %" PRId32, name, gonio_i32(r)); }
static void field_bool(struct gonio_reader *r, const char *name)
{
    say("%s: %s", name, gonio_bool(r) ? "true" : "false");
}

static void axis(struct gonio_reader *r)
{
    static const char *const names[] = {"Tilt", "Spin"};
    say("axis: %s", names[gonio_variant(r, 2)]);
}

static void fault(struct gonio_reader *r)
{
    switch (gonio_variant(r, 5)) {
    case 0: say("LeaseExpired"); break;
    case 1: say("Stall { "); axis(r); say(" }"); break;
    case 2: say("InterlockOpen"); break;
    case 3: say("OverTemperature { "); field_i32(r, "temperature_mc"); say(" }"); break;
    default: say("EmergencyStop"); break;
    }
}

static void option_fault(struct gonio_reader *r)
{
    if (gonio_bool(r)) {
        say("Some(");
        fault(r);
        say(")");
    } else {
        say("None");
    }
}

static void position(struct gonio_reader *r)
{
    say("Position { ");
    field_i32(r, "tilt_udeg");
    say(", ");
    field_i32(r, "spin_udeg");
    say(" }");
}

static void status(struct gonio_reader *r)
{
    static const char *const motions[] = {"Idle", "Homing", "Moving", "Stopping"};
    say("Status { ");
    field_u32(r, "boot");
    say(", ");
    field_u32(r, "uptime_ms");
    say(", ");
    field_bool(r, "homed");
    say(", motion: %s, position: ", motions[gonio_variant(r, 4)]);
    position(r);
    say(", ");
    field_bool(r, "shutter_open");
    say(", ");
    field_bool(r, "lamp_on");
    say(", ");
    field_bool(r, "lamp_warm");
    say(", ");
    field_u32(r, "lamp_level_ppm");
    say(", ");
    field_bool(r, "interlock_closed");
    say(", fault: ");
    option_fault(r);
    say(", ");
    field_u32(r, "triggers");
    say(" }");
}

static void readings(struct gonio_reader *r)
{
    say("SensorReadings { ");
    field_u32(r, "lamp_monitor_ppm");
    say(", ");
    field_i32(r, "lamp_mc");
    say(", ");
    field_i32(r, "ambient_mc");
    say(", ");
    field_i32(r, "sample_height_um");
    say(", ");
    field_bool(r, "interlock_closed");
    say(" }");
}

static void outcome(struct gonio_reader *r)
{
    switch (gonio_variant(r, 5)) {
    case 0: say("Nothing"); break;
    case 1: say("At("); position(r); say(")"); break;
    case 2: say("Sensors("); readings(r); say(")"); break;
    case 3: say("Status("); status(r); say(")"); break;
    default: say("Triggered { "); field_u32(r, "count"); say(" }"); break;
    }
}

static void reason(struct gonio_reader *r)
{
    switch (gonio_variant(r, 9)) {
    case 0: say("FaultLatched("); fault(r); say(")"); break;
    case 1: say("NotHomed"); break;
    case 2: say("Busy"); break;
    case 3:
        say("OutsideLimits { ");
        axis(r);
        say(", ");
        field_i32(r, "min_udeg");
        say(", ");
        field_i32(r, "max_udeg");
        say(" }");
        break;
    case 4:
        say("Rate { ");
        field_u32(r, "max_speed_udeg_s");
        say(", ");
        field_u32(r, "max_accel_udeg_s2");
        say(" }");
        break;
    case 5: say("Level"); break;
    case 6: say("InterlockOpen"); break;
    case 7: say("Forgotten"); break;
    default: say("FaultPersists("); fault(r); say(")"); break;
    }
}

static void reply(struct gonio_reader *r)
{
    switch (gonio_variant(r, 4)) {
    case 0: say("Accepted"); break;
    case 1: say("Done("); outcome(r); say(")"); break;
    case 2: say("Rejected("); reason(r); say(")"); break;
    default: say("Aborted("); option_fault(r); say(")"); break;
    }
}

static void command(struct gonio_reader *r)
{
    switch (gonio_variant(r, 9)) {
    case 0: say("Home"); break;
    case 1:
        say("Move { ");
        field_i32(r, "tilt_udeg");
        say(", ");
        field_i32(r, "spin_udeg");
        say(", ");
        field_u32(r, "speed_udeg_s");
        say(", ");
        field_u32(r, "accel_udeg_s2");
        say(" }");
        break;
    case 2: say("Stop"); break;
    case 3: say("Shutter { "); field_bool(r, "open"); say(" }"); break;
    case 4:
        say("Lamp { ");
        field_bool(r, "on");
        say(", ");
        field_u32(r, "level_ppm");
        say(" }");
        break;
    case 5: say("Sensors"); break;
    case 6: say("CameraTrigger { "); field_u32(r, "exposure_us"); say(" }"); break;
    case 7: say("Status"); break;
    default: say("Rearm"); break;
    }
}

static void to_device(struct gonio_reader *r)
{
    switch (gonio_variant(r, 3)) {
    case 0:
        say("Command { ");
        field_u32(r, "id");
        say(", command: ");
        command(r);
        say(" }");
        break;
    case 1: say("Heartbeat { "); field_u32(r, "counter"); say(" }"); break;
    default: say("EmergencyStop { "); field_u32(r, "id"); say(" }"); break;
    }
}

static void to_host(struct gonio_reader *r)
{
    switch (gonio_variant(r, 4)) {
    case 0:
        say("Reply { ");
        field_u32(r, "id");
        say(", reply: ");
        reply(r);
        say(" }");
        break;
    case 1:
        say("Fault { fault: ");
        fault(r);
        say(", ");
        field_u32(r, "uptime_ms");
        say(" }");
        break;
    case 2:
        say("Telemetry(Telemetry { ");
        field_u32(r, "counter");
        say(", status: ");
        status(r);
        say(" })");
        break;
    default: say("EmergencyStopped { "); field_u32(r, "id"); say(" }"); break;
    }
}

static void hello(const struct gonio_hello *h)
{
    static const char *const roles[] = {"Ask", "Answer", "Announce"};
    say("%s protocol=%u window=%u schema=%016" PRIx64 " version=%u.%u.%u boot=%" PRIu32 " session=%" PRIu32
        " client=%" PRIu32 " serial=%s",
        roles[h->role], (unsigned)h->protocol, (unsigned)h->window, h->schema, (unsigned)h->version[0],
        (unsigned)h->version[1], (unsigned)h->version[2], h->boot, h->session, h->client, h->serial);
}

/* 1 if the body holds exactly one message. */
static int frame(const struct gonio_frame *f, int for_device)
{
    static const char *const kinds[] = {"Data", "Ack", "Datagram"};
    struct gonio_reader r;
    say("%s session=%" PRIu32 " seq=%u ack=%u", kinds[f->kind], f->session, (unsigned)f->seq, (unsigned)f->ack);
    if (f->kind == GONIO_ACK)
        return f->body_len == 0;
    r.at = f->body;
    r.end = f->body + f->body_len;
    r.bad = 0;
    say(" ");
    if (for_device)
        to_device(&r);
    else
        to_host(&r);
    return !r.bad && r.at == r.end;
}

static int nibble(int c) { return c >= '0' && c <= '9' ? c - '0' : c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1; }

int main(void)
{
    static char line[4096];
    while (fgets(line, sizeof line, stdin)) {
        struct gonio_decoder d;
        int packets = 0, refused = 0, for_device = strncmp(line, "device ", 7) == 0;
        const char *p = strchr(line, ' ');
        gonio_decoder_init(&d);
        text_len = 0;
        text[0] = 0;
        for (p = p ? p + 1 : line; nibble(p[0]) >= 0 && nibble(p[1]) >= 0; p += 2) {
            enum gonio_result result = gonio_decoder_push(&d, (uint8_t)(nibble(p[0]) << 4 | nibble(p[1])));
            if (result == GONIO_REFUSED) {
                refused = 1;
            } else if (result == GONIO_HELLO_PACKET) {
                packets++;
                hello(&d.hello);
            } else if (result == GONIO_FRAME_PACKET) {
                packets++;
                refused |= !frame(&d.frame, for_device);
            }
        }
        puts(packets == 1 && !refused ? text : "refused");
    }
    return 0;
}
