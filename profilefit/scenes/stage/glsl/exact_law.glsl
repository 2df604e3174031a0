// The row of a table by its albedo.

const int LAW_rows = @ROWS@;
const float LAW_alphas[LAW_rows] = float[](@ALPHAS@);

LAW_Shape LAW_shape(float alpha) {
    LAW_Shape s;
    s.row = 0;
    for (int i = 1; i < LAW_rows; ++i) {
        if (abs(LAW_alphas[i] - alpha) < abs(LAW_alphas[s.row] - alpha)) s.row = i;
    }
    return s;
}

float LAW_alpha(float reflectance) {
    int row = 0;
    for (int i = 1; i < LAW_rows; ++i) {
        if (abs(LAW_reflectances[i] - reflectance) < abs(LAW_reflectances[row] - reflectance)) row = i;
    }
    return LAW_alphas[row];
}
