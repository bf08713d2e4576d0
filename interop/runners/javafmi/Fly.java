import java.io.PrintWriter;
import java.nio.file.Files;
import java.nio.file.Path;
import java.util.List;
import org.javafmi.proxy.Status;
import org.javafmi.proxy.v2.State;
import org.javafmi.wrapper.Simulation;
import org.javafmi.wrapper.v2.Access;

/** JavaFMI, Co-Simulation: variables by name, the state saved and restored on the way. */
public class Fly {
    static final String[] OUTPUTS = "u,w,r,x,y,z,psi,F_l,F_r,F_t,tau_rear".split(",");

    public static void main(String[] arguments) throws Exception {
        List<String> rows = Files.readAllLines(Path.of("manoeuvre.csv"));
        String[] names = rows.get(0).split(",");
        int detour = names.length - 1;
        Simulation rov = new Simulation("videoray.fmu");
        Access access = new Access(rov);
        for (String line : Files.readAllLines(Path.of("parameters.csv")).stream().skip(1).toList()) {
            String[] parameter = line.split(",");
            rov.write(parameter[0]).with(Double.parseDouble(parameter[1]));
        }
        check(rov.init(0.0));
        try (PrintWriter result = new PrintWriter("result.csv")) {
            result.println("time," + String.join(",", OUTPUTS));
            print(result, 0.0, rov);
            for (int n = 1; n + 1 < rows.size(); n++) {
                String[] row = rows.get(n).split(",");
                double end = Double.parseDouble(rows.get(n + 1).split(",")[0]);
                if (row[detour].equals("1")) {
                    State state = access.getState(State.newEmptyState());
                    rov.write("u_l").with(1.0);
                    check(access.doStep(rov.getCurrentTime(), 1.0));
                    check(access.setState(state));
                    access.freeState(state);
                }
                for (int i = 1; i < detour; i++) {
                    rov.write(names[i]).with(Double.parseDouble(row[i]));
                }
                check(rov.doStep(0.1));
                print(result, end, rov);
            }
        }
        rov.terminate();
    }

    static void print(PrintWriter result, double time, Simulation rov) {
        result.print(time);
        for (String name : OUTPUTS) {
            result.print("," + rov.read(name).asDouble());
        }
        result.println();
    }

    static void check(Status status) {
        if (status != Status.OK) {
            throw new IllegalStateException("the FMU answered " + status);
        }
    }
}
