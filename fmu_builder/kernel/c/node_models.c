/* Models at the nodes of a table as sums of local models; needs kernel.c. */

/* nodes[k] = sum_i w_ki rows[i] with the weights of the local models at every node of the table */
RARE void kernel_nodes(const Tables *t, const double *rows, int length, double *nodes) {
    KernelBlend blend;
    int k;
    blend.first = 0;
    blend.count = FIXED(t, local_models);
    for (k = 0; k < FIXED(t, nodes); ++k) {
        blend.weights = t->node_weights + k * FIXED(t, local_models);
        kernel_blended(&blend, rows, length, nodes + k * length);
    }
}
