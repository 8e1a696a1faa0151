/* What libraries print to the stream stderr; the file descriptor stays as it is, so that reports of
 * a sanitizer are seen. */
#ifndef CAPTURED_STDERR_H
#define CAPTURED_STDERR_H

/* From now on all that is printed to stderr is kept. */
void captured_stderr_begin(void);

/* Ends it; the text printed since, up to a limit. Valid until the next beginning. */
const char *captured_stderr_end(void);

#endif
