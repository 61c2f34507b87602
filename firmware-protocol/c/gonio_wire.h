/* Decoder for the wire of SPEC.md, in C99, without allocation. Written from SPEC.md alone. */
#ifndef GONIO_WIRE_H
#define GONIO_WIRE_H

#include <stddef.h>
#include <stdint.h>

#define GONIO_MAX_BODY 128
#define GONIO_HEADER 10
#define GONIO_MAX_PACKET (GONIO_HEADER + GONIO_MAX_BODY + 4)
#define GONIO_MAX_ENCODED (GONIO_MAX_PACKET + 2)
#define GONIO_HELLO 50
#define GONIO_VERSION 1

enum gonio_result { GONIO_MORE, GONIO_HELLO_PACKET, GONIO_FRAME_PACKET, GONIO_REFUSED };
enum gonio_kind { GONIO_DATA = 0, GONIO_ACK = 1, GONIO_DATAGRAM = 2 };

struct gonio_hello {
    uint8_t role, protocol;
    uint16_t window;
    uint64_t schema;
    uint16_t version[3];
    uint32_t boot, session, client;
    char serial[17]; /* with an end mark */
};

struct gonio_frame {
    uint8_t kind;
    uint32_t session;
    uint16_t seq, ack;
    uint8_t body[GONIO_MAX_BODY];
    size_t body_len;
};

struct gonio_decoder {
    uint8_t buffer[GONIO_MAX_ENCODED];
    size_t len;
    int overrun;
    struct gonio_hello hello; /* valid after GONIO_HELLO_PACKET */
    struct gonio_frame frame; /* valid after GONIO_FRAME_PACKET */
};

/* A cursor over a body; `bad` is set once something does not decode. */
struct gonio_reader {
    const uint8_t *at, *end;
    int bad;
};

void gonio_decoder_init(struct gonio_decoder *d);
enum gonio_result gonio_decoder_push(struct gonio_decoder *d, uint8_t byte);

uint32_t gonio_crc32(const uint8_t *bytes, size_t len);

uint32_t gonio_u32(struct gonio_reader *r);
int32_t gonio_i32(struct gonio_reader *r);
int gonio_bool(struct gonio_reader *r);
/* Number of an enum's variant; `bad` if it is not below `count`. */
uint32_t gonio_variant(struct gonio_reader *r, uint32_t count);

#endif
