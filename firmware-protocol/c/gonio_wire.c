#include "gonio_wire.h"

#include <string.h>

void gonio_decoder_init(struct gonio_decoder *d) { memset(d, 0, sizeof *d); }

/* SPEC 1: reflected, polynomial 0xEDB88320, start and final XOR 0xFFFFFFFF. Bit by bit: small before fast. */
uint32_t gonio_crc32(const uint8_t *bytes, size_t len)
{
    uint32_t crc = 0xFFFFFFFFu;
    for (size_t i = 0; i < len; i++) {
        crc ^= bytes[i];
        for (int bit = 0; bit < 8; bit++)
            crc = (crc >> 1) ^ (0xEDB88320u & (0u - (crc & 1u)));
    }
    return crc ^ 0xFFFFFFFFu;
}

static uint16_t le16(const uint8_t *p) { return (uint16_t)(p[0] | p[1] << 8); }
static uint32_t le32(const uint8_t *p) { return (uint32_t)le16(p) | (uint32_t)le16(p + 2) << 16; }

/* SPEC 1: COBS. Gives the length, or -1 if a code points past the end or is zero. `out` holds GONIO_MAX_ENCODED. */
static int uncobs(const uint8_t *in, size_t len, uint8_t *out)
{
    size_t i = 0, o = 0;
    while (i < len) {
        uint8_t code = in[i++];
        if (code == 0 || (size_t)(code - 1) > len - i)
            return -1;
        memcpy(out + o, in + i, (size_t)(code - 1));
        o += (size_t)(code - 1);
        i += (size_t)(code - 1);
        if (code != 0xFF && i < len)
            out[o++] = 0;
    }
    return (int)o;
}

static enum gonio_result open_hello(struct gonio_hello *h, const uint8_t *p, size_t len)
{
    if (len != GONIO_HELLO || p[4] > 2)
        return GONIO_REFUSED;
    h->role = p[4];
    h->protocol = p[5];
    h->window = le16(p + 6);
    h->schema = (uint64_t)le32(p + 8) | (uint64_t)le32(p + 12) << 32;
    for (int i = 0; i < 3; i++)
        h->version[i] = le16(p + 16 + 2 * i);
    h->boot = le32(p + 22);
    h->session = le32(p + 26);
    h->client = le32(p + 30);
    memcpy(h->serial, p + 34, 16);
    h->serial[16] = 0;
    return GONIO_HELLO_PACKET;
}

static enum gonio_result open_frame(struct gonio_frame *f, const uint8_t *p, size_t len)
{
    if (len < GONIO_HEADER || len > GONIO_HEADER + GONIO_MAX_BODY || p[0] != GONIO_VERSION || p[1] > 2)
        return GONIO_REFUSED;
    f->kind = p[1];
    f->session = le32(p + 2);
    f->seq = le16(p + 6);
    f->ack = le16(p + 8);
    f->body_len = len - GONIO_HEADER;
    memcpy(f->body, p + GONIO_HEADER, f->body_len);
    return GONIO_FRAME_PACKET;
}

enum gonio_result gonio_decoder_push(struct gonio_decoder *d, uint8_t byte)
{
    uint8_t packet[GONIO_MAX_ENCODED];
    size_t len = d->len;
    int found, overrun = d->overrun;
    if (byte != 0) {
        if (d->len < sizeof d->buffer)
            d->buffer[d->len++] = byte;
        else
            d->overrun = 1;
        return GONIO_MORE;
    }
    d->len = 0;
    d->overrun = 0;
    if (overrun)
        return GONIO_REFUSED;
    if (len == 0)
        return GONIO_MORE;
    found = uncobs(d->buffer, len, packet);
    if (found < 4)
        return GONIO_REFUSED;
    len = (size_t)found - 4;
    if (gonio_crc32(packet, len) != le32(packet + len))
        return GONIO_REFUSED;
    if (len >= 4 && memcmp(packet, "GNIO", 4) == 0)
        return open_hello(&d->hello, packet, len);
    return open_frame(&d->frame, packet, len);
}

/* SPEC 5: varint, seven bits per byte, low group first, at most five bytes and 32 bits. */
uint32_t gonio_u32(struct gonio_reader *r)
{
    uint32_t value = 0;
    for (int shift = 0; shift < 35; shift += 7) {
        uint8_t byte;
        if (r->at == r->end)
            break;
        byte = *r->at++;
        if (shift == 28 && (byte & 0xF0))
            break;
        value |= (uint32_t)(byte & 0x7F) << shift;
        if (!(byte & 0x80))
            return value;
    }
    r->bad = 1;
    return 0;
}

/* SPEC 5: zigzag. */
int32_t gonio_i32(struct gonio_reader *r)
{
    uint32_t z = gonio_u32(r);
    return (z & 1u) ? -(int32_t)(z >> 1) - 1 : (int32_t)(z >> 1);
}

int gonio_bool(struct gonio_reader *r)
{
    if (r->at == r->end || *r->at > 1) {
        r->bad = 1;
        return 0;
    }
    return *r->at++;
}

uint32_t gonio_variant(struct gonio_reader *r, uint32_t count)
{
    uint32_t v = gonio_u32(r);
    if (v >= count) {
        r->bad = 1;
        return 0;
    }
    return v;
}
