/* States of an instance saved, restored, and turned into bytes: the continuation is the same to the last bit. */

typedef struct {
    uint64_t magic, model, size, check;
} Header;

static uint64_t hash(const unsigned char *bytes, size_t n) {
    uint64_t value = 14695981039346656037ull;
    size_t i;
    for (i = 0; i < n; i++) value = (value ^ bytes[i]) * 1099511628211ull;
    return value;
}

static uint64_t model_hash(void) { return hash((const unsigned char *)TOKEN, sizeof TOKEN); }

/* The instance keeps a list of its snapshots: a handle that is not on it is refused, not followed. */
static Snapshot *find(Instance *I, const void *handle) {
    Snapshot *each = I->snapshots;
    while (each && each != handle) each = each->next;
    return each;
}

static Snapshot *new_snapshot(Instance *I) {
    Snapshot *made = calloc(1, sizeof *made);
    if (!made) return NULL;
    made->next = I->snapshots;
    I->snapshots = made;
    return made;
}

/* A place for a snapshot: the one that the handle names, or a new one where it is null. */
static Snapshot *place_for(Instance *I, const char *function, void **handle) {
    Snapshot *place;
    if (!handle) return core_fail(I, function, "null pointer"), NULL;
    if (*handle) {
        place = find(I, *handle);
        if (!place) core_fail(I, function, "not a state of this instance");
        return place;
    }
    place = new_snapshot(I);
    if (!place) core_fail(I, function, "out of memory");
    return place;
}

static Status core_save(Instance *I, const char *function, void **handle) {
    Snapshot *place = place_for(I, function, handle);
    if (!place) return ERROR;
    place->data = I->data;
    *handle = place;
    return OK;
}

static Status core_restore(Instance *I, const char *function, void *handle) {
    Snapshot *saved = find(I, handle);
    if (!saved) return core_fail(I, function, "not a state of this instance");
    I->data = saved->data;
    I->last_time = I->data.time;
    I->last_step = OK;
    core_forget_all(I);
    return OK;
}

static Status core_drop(Instance *I, const char *function, void **handle) {
    Snapshot **link = &I->snapshots;
    if (!handle || !*handle) return OK;
    while (*link && *link != *handle) link = &(*link)->next;
    if (!*link) return core_fail(I, function, "not a state of this instance");
    *link = (*link)->next;
    free(*handle);
    *handle = NULL;
    return OK;
}

static Status core_serialized_size(Instance *I, const char *function, void *handle, size_t *size) {
    if (!find(I, handle) || !size) return core_fail(I, function, "not a state of this instance");
    *size = sizeof(Header) + sizeof(Data);
    return OK;
}

static Status core_serialize(Instance *I, const char *function, void *handle, unsigned char *bytes, size_t size) {
    Snapshot *saved = find(I, handle);
    Header header;
    if (!saved || !bytes) return core_fail(I, function, "not a state of this instance");
    if (size < sizeof(Header) + sizeof(Data)) return core_fail(I, function, "%u bytes are too few", (unsigned)size);
    header.magic = MAGIC;
    header.model = model_hash();
    header.size = sizeof(Data);
    header.check = hash((const unsigned char *)&saved->data, sizeof(Data));
    memcpy(bytes, &header, sizeof header);
    memcpy(bytes + sizeof header, &saved->data, sizeof(Data));
    return OK;
}

static Status core_deserialize(Instance *I, const char *function, const unsigned char *bytes, size_t size, void **handle) {
    Header header;
    Data data;
    Snapshot *place;
    if (!bytes || size < sizeof header + sizeof data) return core_fail(I, function, "%u bytes are no state", (unsigned)size);
    memcpy(&header, bytes, sizeof header);
    memcpy(&data, bytes + sizeof header, sizeof data);
    if (header.magic != MAGIC || header.model != model_hash() || header.size != sizeof data)
        return core_fail(I, function, "a state of another FMU");
    if (header.check != hash((const unsigned char *)&data, sizeof data)) return core_fail(I, function, "a damaged state");
    if (data.type != I->data.type) return core_fail(I, function, "a state of the other interface type");
    place = place_for(I, function, handle);
    if (!place) return ERROR;
    place->data = data;
    *handle = place;
    return OK;
}
