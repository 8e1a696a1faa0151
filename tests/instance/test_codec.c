#include "codec.h"

#include <limits.h>
#include <math.h>
#include <string.h>
#include <unity.h>

static const char guid[] = "{guid}";

struct fields {
    double real;
    int64_t number;
    int small;
    unsigned natural;
    bool flag;
};

static const struct fields some = {-0.1, INT64_MIN, INT_MAX, UINT_MAX, true};

static void transfer(struct codec *codec, struct fields *fields) {
    codec_real(codec, &fields->real);
    codec_int64(codec, &fields->number);
    codec_int(codec, "small", &fields->small);
    codec_unsigned(codec, "natural", &fields->natural);
    codec_bool(codec, "flag", &fields->flag);
}

static size_t written(unsigned char bytes[128]) {
    struct fields fields = some;
    struct codec counting = codec_counting();
    codec_begin(&counting, guid);
    transfer(&counting, &fields);
    codec_end(&counting);

    struct codec writing = codec_writing(bytes, counting.at);
    codec_begin(&writing, guid);
    transfer(&writing, &fields);
    codec_end(&writing);
    TEST_ASSERT_EQUAL_UINT64(counting.at, writing.at);
    TEST_ASSERT_FALSE(writing.is_cut_off);
    TEST_ASSERT_NULL(writing.bad_field);
    return writing.at;
}

static const char *read(const unsigned char *bytes, size_t size, size_t length,
                        struct fields *fields) {
    struct codec reading = codec_reading(bytes, size);
    const char *fault = codec_check(&reading, guid, length);
    if (fault == NULL) {
        transfer(&reading, fields);
        fault = reading.is_cut_off ? "cut off" : reading.bad_field;
    }
    return fault;
}

static void test_what_is_written_is_read(void) {
    unsigned char bytes[128];
    struct fields fields = {0};
    const size_t size = written(bytes);
    TEST_ASSERT_NULL(read(bytes, size, size, &fields));
    TEST_ASSERT_EQUAL_DOUBLE(some.real, fields.real);
    TEST_ASSERT_TRUE(some.number == fields.number);
    TEST_ASSERT_EQUAL_INT(some.small, fields.small);
    TEST_ASSERT_EQUAL_UINT(some.natural, fields.natural);
    TEST_ASSERT_TRUE(fields.flag);
}

static void test_the_layout_is_little_endian(void) {
    unsigned char bytes[128];
    const size_t size = written(bytes);
    const unsigned char start[] = {
        'C', 'O', 'S', 'I', 'M', 'S', 'T', 'A', 2, 0, 0, 0, (unsigned char)size,
        0,   0,   0,   6,   0,   0,   0,   '{'};
    TEST_ASSERT_EQUAL_MEMORY(start, bytes, sizeof start);
    const unsigned char minus_a_tenth[] = {0x9a, 0x99, 0x99, 0x99, 0x99, 0x99, 0xb9, 0xbf};
    TEST_ASSERT_EQUAL_MEMORY(minus_a_tenth, bytes + 20 + strlen(guid), 8);
}

/* Nothing behind the end is read or written. */
static void test_what_does_not_fit_is_cut_off(void) {
    unsigned char bytes[8] = {1, 2, 3, 4, 5, 6, 7, 8};
    double real = 0.5;
    struct codec reading = codec_reading(bytes, 7);
    codec_real(&reading, &real);
    TEST_ASSERT_TRUE(reading.is_cut_off && real == 0.5);
    struct codec writing = codec_writing(bytes, 7);
    codec_real(&writing, &real);
    TEST_ASSERT_TRUE(writing.is_cut_off && bytes[0] == 1 && bytes[7] == 8);
}

static void test_values_that_a_type_does_not_have_fail(void) {
    unsigned char bytes[8] = {2};
    struct codec codec = codec_reading(bytes, sizeof bytes);
    bool flag = false;
    codec_bool(&codec, "flag", &flag);
    TEST_ASSERT_EQUAL_STRING("flag", codec.bad_field);
    TEST_ASSERT_FALSE(flag);

    memset(bytes, 0x7f, sizeof bytes);
    codec = codec_reading(bytes, sizeof bytes);
    int number = 0;
    codec_int(&codec, "number", &number);
    TEST_ASSERT_EQUAL_STRING("number", codec.bad_field);
    TEST_ASSERT_EQUAL_INT(0, number);
}
