/* message.c with a door, so that Python can read what it writes. */
#include "message.c"

EXPORTED unsigned message_of_number(double value, char *text);
EXPORTED unsigned message_of_integer(long long value, char *text);
EXPORTED unsigned message_of_text(const char *first, const char *second, char *text);

static unsigned message_copy(const Message *message, char *text)
{
    for (unsigned k = 0; k <= message->length; ++k) {
        text[k] = message->text[k];
    }
    return message->length;
}

unsigned message_of_number(double value, char *text)
{
    Message message;
    message_clear(&message);
    message_append_number(&message, value);
    return message_copy(&message, text);
}

unsigned message_of_integer(long long value, char *text)
{
    Message message;
    message_clear(&message);
    message_append_integer(&message, value);
    return message_copy(&message, text);
}

unsigned message_of_text(const char *first, const char *second, char *text)
{
    Message message;
    message_clear(&message);
    message_append(&message, first);
    message_append(&message, second);
    return message_copy(&message, text);
}
