/* Saving and restoring: in memory and as bytes, whole, cut and damaged. */

static Pair *any_pair(void)
{
    for (unsigned k = 0; k < PAIRS; ++k) {
        if (pairs[k].main != NULL) {
            return &pairs[k];
        }
    }
    return NULL;
}

static void call_save(Pair *pair)
{
    Saved *place = &saved[take_below(SAVED)];
    const fmi2FMUstate before = place->main;
    fmi2Status status;
    if (HEAP_CAN_FAIL && place->main == NULL && take_chance(8)) {
        heap_is_empty = 1;
        ASK(pair, ALWAYS, MUST_FAIL, GetFMUstate, &place->main);
        heap_is_empty = 0;
        REQUIRE(place->main == NULL, "a state without memory");
        return;
    }
    ASK(pair, ALWAYS, MUST_FAIL, GetFMUstate, NULL);
    ASK(pair, ALWAYS, MUST_WORK, GetFMUstate, &place->main);
    REQUIRE(place->main != NULL && (before == NULL || place->main == before), "the state is in no place");
    REQUIRE(fmu.GetFMUstate(pair->shadow, &place->shadow) == fmi2OK, "the shadow has no state");
    place->kind = pair->kind;
    place->life = pair->life;
}

static void call_restore(Pair *pair)
{
    const Saved *place = &saved[take_below(SAVED)];
    const int fits = place->main != NULL && place->kind == pair->kind;
    fmi2Status status;
    ASK(pair, ALWAYS, fits ? MUST_WORK : MUST_FAIL, SetFMUstate, place->main);
    if (status == fmi2OK) {
        REQUIRE(fmu.SetFMUstate(pair->shadow, place->shadow) == fmi2OK, "the shadow does not go back");
        pair->life = place->life;
    }
}

static void call_free_state(Pair *pair)
{
    Saved *place = &saved[take_below(SAVED)];
    fmi2Status status;
    ASK(pair, ALWAYS, MUST_WORK, FreeFMUstate, &place->main);
    REQUIRE(place->main == NULL, "a freed state is still there");
    ASK(pair, ALWAYS, MUST_WORK, FreeFMUstate, &place->main);
    ASK(pair, ALWAYS, MAY_FAIL, FreeFMUstate, NULL);
    REQUIRE(fmu.FreeFMUstate(pair->shadow, &place->shadow) == fmi2OK, "the shadow does not free");
}

static void call_serialize(Pair *pair)
{
    const Saved *place = &saved[take_below(SAVED)];
    Stored *store = &stored[take_below(STORED)];
    size_t size = 0;
    fmi2Status status;
    ASK(pair, ALWAYS, place->main != NULL ? MUST_WORK : MUST_FAIL, SerializedFMUstateSize, place->main, &size);
    ASK(pair, ALWAYS, MUST_FAIL, SerializedFMUstateSize, place->main, NULL);
    if (place->main == NULL) {
        return;
    }
    free(store->main);
    free(store->shadow);
    store->main = block(size, 1);
    store->shadow = block(size, 1);
    store->size = size;
    store->kind = place->kind;
    store->life = place->life;
    ASK(pair, ALWAYS, MUST_FAIL, SerializeFMUstate, place->main, NULL, size);
    ASK(pair, ALWAYS, MUST_FAIL, SerializeFMUstate, NULL, store->main, size);
    ASK(pair, ALWAYS, MUST_FAIL, SerializeFMUstate, place->main, store->main, take_below(255) * size / 255);
    fmi2Byte *small = block(size - 1, 1);
    ASK(pair, ALWAYS, MUST_FAIL, SerializeFMUstate, place->main, small, size - 1);
    free(small);
    ASK(pair, ALWAYS, MUST_WORK, SerializeFMUstate, place->main, store->main, size);
    REQUIRE(fmu.SerializeFMUstate(pair->shadow, place->shadow, store->shadow, size) == fmi2OK, "no bytes of the shadow");
}

static void call_deserialize(Pair *pair)
{
    const Stored *store = &stored[take_below(STORED)];
    Saved *place = &saved[take_below(SAVED)];
    const unsigned damage = take();
    const fmi2FMUstate before = place->main;
    fmi2Status status;
    ASK(pair, ALWAYS, MUST_FAIL, DeSerializeFMUstate, NULL, 1000, &place->main);
    if (store->main == NULL) {
        return;
    }
    ASK(pair, ALWAYS, MUST_FAIL, DeSerializeFMUstate, store->main, store->size, NULL);
    if (damage >= 100) { /* cut, drawn out, or some bits turned over */
        const size_t size = damage < 150 ? take() * store->size / 256 : damage < 170 ? store->size + 1 + take() : store->size;
        fmi2Byte *bytes = block(size, 1);
        for (size_t k = 0; k < size; ++k) {
            bytes[k] = k < store->size ? store->main[k] : (fmi2Byte)k;
        }
        for (unsigned k = 0; damage >= 170 && k <= take_below(3); ++k) {
            bytes[(take() * 256U + take()) % size] ^= (fmi2Byte)(1U << take_below(8));
        }
        if (size != store->size || memcmp(bytes, store->main, size) != 0) {
            ASK(pair, ALWAYS, MUST_FAIL, DeSerializeFMUstate, bytes, size, &place->main);
            REQUIRE(place->main == before, "damaged bytes became a state");
        }
        free(bytes);
        return;
    }
    if (HEAP_CAN_FAIL && damage > 90 && place->main == NULL) {
        heap_is_empty = 1;
        ASK(pair, ALWAYS, MUST_FAIL, DeSerializeFMUstate, store->main, store->size, &place->main);
        heap_is_empty = 0;
        REQUIRE(place->main == NULL, "a state without memory");
        return;
    }
    ASK(pair, ALWAYS, MUST_WORK, DeSerializeFMUstate, store->main, store->size, &place->main);
    REQUIRE(fmu.DeSerializeFMUstate(pair->shadow, store->shadow, store->size, &place->shadow) == fmi2OK, "the shadow cannot");
    place->kind = store->kind;
    place->life = store->life;
}

/** let a new instance, brought to the state of this one, take the place of its shadow: it goes on the same way */
static void call_migrate(Pair *pair)
{
    const int as_bytes = (int)take_below(2);
    fmi2Component next = fmu.Instantiate("next", (fmi2Type)pair->kind, MODEL_GUID, NULL, NULL, 0, 0);
    fmi2FMUstate state = NULL, there = NULL;
    size_t size = 0;
    REQUIRE(next != NULL && fmu.GetFMUstate(pair->main, &state) == fmi2OK, "no copy");
    if (as_bytes) {
        REQUIRE(fmu.SerializedFMUstateSize(pair->main, state, &size) == fmi2OK, "no size");
        fmi2Byte *bytes = block(size, 1);
        REQUIRE(fmu.SerializeFMUstate(pair->main, state, bytes, size) == fmi2OK, "no bytes");
        REQUIRE(fmu.DeSerializeFMUstate(next, bytes, size, &there) == fmi2OK, "the bytes do not become a state");
        free(bytes);
        REQUIRE(fmu.FreeFMUstate(pair->main, &state) == fmi2OK, "no end of a state");
    } else {
        there = state;
    }
    REQUIRE(fmu.SetFMUstate(next, there) == fmi2OK && fmu.FreeFMUstate(next, &there) == fmi2OK, "no copy");
    fmu.FreeInstance(pair->shadow);
    pair->shadow = next;
    pair->migrated = 1;
}
